// Intersection of a line of sight with the exact surface of a face, near a triangle that
// approximates it.

import type { SurfaceDoc } from "./scene";
import { along, cross, dot, sub, type V3 } from "./vector";

/** Signed distance of a point from a surface, in coordinates of the surface's frame; correct to
 *  first order near the surface. */
const AWAY: Record<SurfaceDoc["kind"], (p: V3, m: number[]) => number> = {
  plane: ([, , z]) => z,
  cylinder: ([x, y], [radius]) => Math.hypot(x, y) - radius,
  cone: ([x, y, z], [radius, angle]) =>
    (Math.hypot(x, y) - radius - z * Math.tan(angle)) * Math.cos(angle),
  sphere: ([x, y, z], [radius]) => Math.hypot(x, y, z) - radius,
  torus: ([x, y, z], [major, minor]) => Math.hypot(Math.hypot(x, y) - major, z) - minor,
  ellipsoid: ([x, y, z], [a, b, c]) => (Math.hypot(x / a, y / b, z / c) - 1) * Math.min(a, b, c),
};

/** Maximum number of secant steps; two steps double the number of correct digits. */
const STEPS = 20;

/** Returns the distance along a ray at which it meets the surface, at most `reach` away from
 *  `near`; null if it does not. */
export function meetSurface(
  surface: SurfaceDoc,
  o: V3,
  d: V3,
  near: number,
  reach: number,
): number | null {
  const { origin, x, z, measures } = surface;
  const y = cross(z, x);
  const away = (t: number) => {
    const p = sub(along(o, d, t), origin);
    return AWAY[surface.kind]([dot(p, x), dot(p, y), dot(p, z)], measures);
  };
  let [a, b] = [near, near + 1e-3 * reach];
  let [f, g] = [away(a), away(b)];
  for (let k = 0; k < STEPS && g !== 0 && f !== g; k++) {
    const next = b - (g * (b - a)) / (g - f);
    if (!(Math.abs(next - near) <= reach)) return null;
    [a, f, b] = [b, g, next];
    g = away(b);
  }
  return Math.abs(g) <= 1e-9 * reach ? b : null;
}

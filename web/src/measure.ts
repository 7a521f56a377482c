// Measures of three points.

import { cross, dot, norm, sub, unit, type V3 } from "./vector";

/** Returns the angle at the second point in degrees, and the radius of the circle through all
 *  three. */
export function angleAndRadius([a, b, c]: [V3, V3, V3]): { angle: number; radius: number } {
  const [u, v, w] = [sub(a, b), sub(c, b), sub(a, c)];
  const cosine = Math.max(-1, Math.min(1, dot(unit(u), unit(v))));
  const area = norm(cross(u, v));
  return {
    angle: (Math.acos(cosine) * 180) / Math.PI,
    radius: area > 0 ? (norm(u) * norm(v) * norm(w)) / (2 * area) : Infinity,
  };
}

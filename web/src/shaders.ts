// Parts shared by the shaders of all layers.

import { Vector4 } from "three";
import type { Section } from "./layer";
import { dot, type V3 } from "./vector";

/** Lighting from next to the eye, on both sides of faces. */
export const LIGHT = `
vec3 lit(vec3 color, vec3 n, vec3 toEye) {
  if (dot(n, toEye) < 0.0) n = -n;
  vec3 right = vec3(viewMatrix[0][0], viewMatrix[1][0], viewMatrix[2][0]);
  vec3 up = vec3(viewMatrix[0][1], viewMatrix[1][1], viewMatrix[2][1]);
  vec3 light = normalize(toEye + 0.3 * up - 0.2 * right);
  float diffuse = max(dot(n, light), 0.0);
  float shine = pow(max(dot(n, normalize(light + toEye)), 0.0), 40.0);
  return color * (0.46 + 0.58 * diffuse) + 0.1 * shine;
}
`;

/** Colour of caps, with thin hatching. */
export const HATCH = `
vec3 hatched(vec3 color) {
  return mod(floor(gl_FragCoord.x) + floor(gl_FragCoord.y), 10.0) < 1.0 ? 0.72 * color : color;
}
`;

/** Returns the section plane in coordinates relative to an origin; without a section, a plane that
 *  hides nothing. */
export function planeOf(section: Section | null, origin: V3): Vector4 {
  if (!section) return new Vector4(0, 0, 0, 1);
  const [x, y, z] = section.normal;
  return new Vector4(x, y, z, section.offset - dot(section.normal, origin));
}

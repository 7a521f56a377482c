// Curves in space: pairs of points, about the origin of the scene.

import { BufferAttribute, BufferGeometry, Color, LineBasicMaterial, LineDashedMaterial, LineSegments } from "three";
import { share } from "./colors";

/** Segments between pairs of points; dashes of a length where that is not 0. */
export function segments(pairs: Float32Array, color: [number, number, number], dash = 0): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(pairs, 3));
  const paint = new Color().setRGB(...share(color));
  const material = dash ? new LineDashedMaterial({ color: paint, dashSize: dash, gapSize: dash }) : new LineBasicMaterial({ color: paint });
  const lines = new LineSegments(geometry, material);
  if (dash) lines.computeLineDistances();
  lines.frustumCulled = false;
  return lines;
}

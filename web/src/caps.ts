// Cut of a mesh by a plane: polygons of tetrahedra, or the areas enclosed by the outlines of a
// closed surface.

import { ShapeUtils, Vector2 } from "three";
import type { Section } from "./layer";
import { cross, dot, unit, type V3 } from "./vector";

/** Triangles of a cap, three coordinates of the file for each corner. */
export type Cap = number[];

function heights(points: Float64Array, section: Section): Float64Array {
  const h = new Float64Array(points.length / 3);
  for (let i = 0; i < h.length; i++)
    h[i] = dot(section.normal, points.subarray(3 * i, 3 * i + 3)) - section.offset;
  return h;
}

function crossing(points: Float64Array, h: Float64Array, i: number, j: number): V3 {
  const f = h[i] / (h[i] - h[j]);
  return [0, 1, 2].map(
    (k) => points[3 * i + k] + f * (points[3 * j + k] - points[3 * i + k]),
  ) as V3;
}

/** Returns the polygons in which the plane cuts tetrahedra. */
export function ofTetrahedra(points: Float64Array, tets: Uint32Array, section: Section): Cap {
  const h = heights(points, section);
  const cap: Cap = [];
  for (let t = 0; t < tets.length; t += 4) {
    const nodes = [tets[t], tets[t + 1], tets[t + 2], tets[t + 3]];
    const above = nodes.filter((i) => h[i] > 0);
    const below = nodes.filter((i) => h[i] <= 0);
    if (!above.length || !below.length) continue;
    const at = (i: number, j: number) => crossing(points, h, i, j);
    if (above.length === 2) {
      const [a, b, c, d] = [
        at(above[0], below[0]),
        at(above[0], below[1]),
        at(above[1], below[1]),
        at(above[1], below[0]),
      ];
      cap.push(...a, ...b, ...c, ...a, ...c, ...d);
    } else {
      const [one, three] = above.length === 1 ? [above[0], below] : [below[0], above];
      for (const other of three) cap.push(...at(one, other));
    }
  }
  return cap;
}

/** Returns the key of the edge between two nodes. */
const key = (i: number, j: number, n: number) => (i < j ? i * n + j : j * n + i);

/** Returns the closed outlines in which the plane cuts triangles; points are joined by the mesh
 *  edges on which they lie, not by their coordinates. */
function outlines(points: Float64Array, triangles: Uint32Array, section: Section): V3[][] {
  const h = heights(points, section);
  const n = points.length / 3;
  const next = new Map<number, number>();
  const places = new Map<number, V3>();
  for (let t = 0; t < triangles.length; t += 3) {
    const nodes = [triangles[t], triangles[t + 1], triangles[t + 2]];
    const isAbove = nodes.map((i) => h[i] > 0);
    const odd = [0, 1, 2].find(
      (k) => isAbove[k] !== isAbove[(k + 1) % 3] && isAbove[k] !== isAbove[(k + 2) % 3],
    );
    if (odd === undefined) continue;
    const [i, j, k] = [nodes[odd], nodes[(odd + 1) % 3], nodes[(odd + 2) % 3]];
    const ends = [key(i, j, n), key(i, k, n)];
    places.set(ends[0], crossing(points, h, i, j)).set(ends[1], crossing(points, h, i, k));
    const [from, to] = isAbove[odd] ? [ends[0], ends[1]] : [ends[1], ends[0]];
    next.set(from, to);
  }
  const loops: V3[][] = [];
  while (next.size) {
    const start = next.keys().next().value as number;
    const loop: V3[] = [];
    let at: number | undefined = start;
    while (at !== undefined && next.has(at)) {
      loop.push(places.get(at)!);
      const to: number = next.get(at)!;
      next.delete(at);
      at = to;
    }
    if (at === start && loop.length > 2) loops.push(loop);
  }
  return loops;
}

const isWithin = (p: Vector2, loop: Vector2[]): boolean => {
  let inside = false;
  for (let i = 0, j = loop.length - 1; i < loop.length; j = i++) {
    const [a, b] = [loop[i], loop[j]];
    if (a.y > p.y !== b.y > p.y && p.x < ((b.x - a.x) * (p.y - a.y)) / (b.y - a.y) + a.x)
      inside = !inside;
  }
  return inside;
};

/** Returns the areas that the outlines of a closed surface enclose in the plane. Outlines inside
 *  outlines are holes, outlines inside holes are islands. */
export function ofSurface(points: Float64Array, triangles: Uint32Array, section: Section): Cap {
  const loops = outlines(points, triangles, section);
  const x = unit(cross(section.normal, Math.abs(section.normal[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0]));
  const y = cross(section.normal, x);
  const flat = loops.map((loop) => loop.map((p) => new Vector2(dot(x, p), dot(y, p))));
  const depth = flat.map(
    (loop, i) => flat.filter((other, j) => j !== i && isWithin(loop[0], other)).length,
  );
  const cap: Cap = [];
  flat.forEach((outer, i) => {
    if (depth[i] % 2) return;
    const holes = flat
      .map((_, j) => j)
      .filter((j) => depth[j] === depth[i] + 1 && isWithin(flat[j][0], outer));
    const ring = [...loops[i], ...holes.flatMap((j) => loops[j])];
    for (const face of ShapeUtils.triangulateShape(
      outer,
      holes.map((j) => flat[j]),
    )) {
      for (const corner of face) cap.push(...ring[corner]);
    }
  });
  return cap;
}

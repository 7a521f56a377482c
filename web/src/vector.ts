// Points and boxes in double precision.

export type V3 = [number, number, number];
export interface Box {
  lo: V3;
  hi: V3;
}

export const add = (a: ArrayLike<number>, b: ArrayLike<number>): V3 => [
  a[0] + b[0],
  a[1] + b[1],
  a[2] + b[2],
];
export const sub = (a: ArrayLike<number>, b: ArrayLike<number>): V3 => [
  a[0] - b[0],
  a[1] - b[1],
  a[2] - b[2],
];
export const scale = (a: ArrayLike<number>, s: number): V3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: ArrayLike<number>, b: ArrayLike<number>): number =>
  a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: ArrayLike<number>, b: ArrayLike<number>): V3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const norm = (a: ArrayLike<number>): number => Math.hypot(a[0], a[1], a[2]);
export const unit = (a: ArrayLike<number>): V3 => scale(a, 1 / (norm(a) || 1));
export const along = (o: ArrayLike<number>, d: ArrayLike<number>, t: number): V3 => [
  o[0] + t * d[0],
  o[1] + t * d[1],
  o[2] + t * d[2],
];
export const isFinite3 = (a: unknown): a is V3 =>
  Array.isArray(a) && a.length === 3 && a.every((v) => typeof v === "number" && Number.isFinite(v));

/** Returns the smallest box around points. */
export function box(points: Iterable<ArrayLike<number>>): Box {
  const lo: V3 = [Infinity, Infinity, Infinity];
  const hi: V3 = [-Infinity, -Infinity, -Infinity];
  for (const p of points) {
    for (let k = 0; k < 3; k++) {
      lo[k] = Math.min(lo[k], p[k]);
      hi[k] = Math.max(hi[k], p[k]);
    }
  }
  return { lo, hi };
}

/** Returns a cube around a point. */
export function inBox(middle: V3, half: number): Box {
  return { lo: sub(middle, [half, half, half]), hi: add(middle, [half, half, half]) };
}

export const center = (b: Box): V3 => scale(add(b.lo, b.hi), 0.5);
export const diagonal = (b: Box): number => norm(sub(b.hi, b.lo));

/** Returns the smallest box around boxes. */
export function around(boxes: Box[]): Box {
  return box(boxes.flatMap((b) => [b.lo, b.hi]));
}

/** Returns the distances at which a ray enters and leaves a box; null if it misses the box. */
export function through(b: Box, o: V3, d: V3): [number, number] | null {
  let from = -Infinity;
  let to = Infinity;
  for (let k = 0; k < 3; k++) {
    if (d[k] === 0) {
      if (o[k] < b.lo[k] || o[k] > b.hi[k]) return null;
      continue;
    }
    const [p, q] = [(b.lo[k] - o[k]) / d[k], (b.hi[k] - o[k]) / d[k]];
    from = Math.max(from, Math.min(p, q));
    to = Math.min(to, Math.max(p, q));
  }
  return from <= to ? [from, to] : null;
}

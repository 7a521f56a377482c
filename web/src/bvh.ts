// Bounding volume hierarchy over triangles, for the first intersection of a ray.

import { cross, dot, sub, type V3 } from "./vector";

/** Maximum number of triangles in a leaf. */
const LEAF = 6;

export interface Meeting {
  t: number;
  triangle: number;
  u: number;
  v: number;
}

export class Bvh {
  /** Box of each node, as six numbers. */
  private readonly boxes: number[] = [];
  /** For each node: the index of its second child, or minus the index of its first triangle for a
   *  leaf; and its number of triangles. */
  private readonly links: number[] = [];
  private readonly order: Uint32Array;

  constructor(
    private readonly points: Float64Array,
    private readonly triangles: Uint32Array,
  ) {
    const count = triangles.length / 3;
    this.order = Uint32Array.from({ length: count }, (_, i) => i);
    const middles = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 3; k++) {
        middles[3 * i + k] =
          (points[3 * triangles[3 * i] + k] +
            points[3 * triangles[3 * i + 1] + k] +
            points[3 * triangles[3 * i + 2] + k]) /
          3;
      }
    }
    if (count) this.build(middles);
  }

  private build(middles: Float32Array): void {
    // Range of triangles, and the node whose second child they become.
    const tasks: [number, number, number][] = [[0, this.order.length, -1]];
    for (let task = tasks.pop(); task; task = tasks.pop()) {
      const [from, to, parent] = task;
      const node = this.links.length / 2;
      if (parent >= 0) this.links[2 * parent] = node;
      this.boxes.push(...this.boxOf(from, to));
      if (to - from <= LEAF) {
        this.links.push(-from - 1, to - from);
        continue;
      }
      const b = this.boxes.slice(6 * node, 6 * node + 6);
      const size = [b[3] - b[0], b[4] - b[1], b[5] - b[2]];
      const axis = size.indexOf(Math.max(...size));
      const part = this.order.subarray(from, to);
      part.sort((i, j) => middles[3 * i + axis] - middles[3 * j + axis]);
      this.links.push(0, 0);
      const middle = (from + to) >> 1;
      // The first child follows its parent in the list.
      tasks.push([middle, to, node], [from, middle, -1]);
    }
  }

  private boxOf(from: number, to: number): number[] {
    const b = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
    for (let i = from; i < to; i++) {
      for (let c = 0; c < 3; c++) {
        const p = 3 * this.triangles[3 * this.order[i] + c];
        for (let k = 0; k < 3; k++) {
          b[k] = Math.min(b[k], this.points[p + k]);
          b[3 + k] = Math.max(b[3 + k], this.points[p + k]);
        }
      }
    }
    return b;
  }

  /** Returns the first intersection beyond a distance at a point that `counts` accepts. */
  meet(o: V3, d: V3, from: number, counts: (p: V3) => boolean): Meeting | null {
    let best: Meeting | null = null;
    const pending = this.links.length ? [0] : [];
    for (let node = pending.pop(); node !== undefined; node = pending.pop()) {
      if (!this.reaches(node, o, d, from, best ? best.t : Infinity)) continue;
      const [link, count] = [this.links[2 * node], this.links[2 * node + 1]];
      if (link >= 0) {
        pending.push(link, node + 1);
        continue;
      }
      for (let i = 0; i < count; i++) {
        const found = this.triangle(this.order[-link - 1 + i], o, d);
        if (
          found &&
          found.t >= from &&
          (!best || found.t < best.t) &&
          counts([o[0] + found.t * d[0], o[1] + found.t * d[1], o[2] + found.t * d[2]])
        )
          best = found;
      }
    }
    return best;
  }

  private reaches(node: number, o: V3, d: V3, from: number, to: number): boolean {
    for (let k = 0; k < 3; k++) {
      const inverse = 1 / d[k];
      const p = (this.boxes[6 * node + k] - o[k]) * inverse;
      const q = (this.boxes[6 * node + 3 + k] - o[k]) * inverse;
      // A ray in the plane of a side gives 0 * infinity; such a comparison is false and has no
      // effect.
      if (p < q || p > q) {
        from = Math.max(from, Math.min(p, q));
        to = Math.min(to, Math.max(p, q));
      } else if (o[k] < this.boxes[6 * node + k] || o[k] > this.boxes[6 * node + 3 + k]) {
        if (d[k] === 0) return false;
        from = Math.max(from, p);
        to = Math.min(to, p);
      }
    }
    return from <= to * (1 + 1e-12) + 1e-300;
  }

  private triangle(i: number, o: V3, d: V3): Meeting | null {
    const corner = (c: number): ArrayLike<number> => {
      const p = 3 * this.triangles[3 * i + c];
      return this.points.subarray(p, p + 3);
    };
    const a = corner(0);
    const [e, f] = [sub(corner(1), a), sub(corner(2), a)];
    const h = cross(d, f);
    const det = dot(e, h);
    if (det === 0) return null;
    const s = sub(o, a);
    const u = dot(s, h) / det;
    const q = cross(s, e);
    const v = dot(d, q) / det;
    if (u < -1e-9 || v < -1e-9 || u + v > 1 + 1e-9) return null;
    return { t: dot(f, q) / det, triangle: i, u, v };
  }
}

// Models in double precision: values, ranges, intersections with rays, and the cells that contain
// the surface.

import { Ranges } from "./interval";
import type { ModelDoc } from "./scene";
import { Evaluator, LANES, Tape } from "./tape";
import { type V3, add, along, box, diagonal, inBox, type Box } from "./vector";

/** Length of segments, as a fraction of the range, below which only their ends are evaluated. */
const FINEST = 1 / 4096;
/** Maximum number of segments of a ray. */
const MOST_SEGMENTS = 20_000;
/** Factor by which the search region exceeds the original box of the model. */
const REACH = 4;
/** Maximum number of times that the region grows if the surface reaches its border. */
const GROWTHS = 5;
/** Size of the search grid. */
const SEARCH: V3 = [24, 24, 24];
/** Maximum number of times that the region shrinks. */
const SHRINKS = 10;

/** Grid over a box, with the cells that may contain surface. */
export interface Brick {
  box: Box;
  n: V3;
  cells: Uint8Array;
}

/** Returns for each cell the number of cells to the nearest that may contain surface, along the
 *  axis on which it is the farthest: 0 for those cells themselves, 255 at most. */
export function gaps({ n, cells }: Brick): Uint8Array<ArrayBuffer> {
  // A border of one cell stands for what is around the grid.
  const m = n.map((k) => k + 2);
  const wide = new Uint8Array(m[0] * m[1] * m[2]).fill(255);
  const place = (x: number, y: number, z: number) => x + 1 + m[0] * (y + 1 + m[1] * (z + 1));
  const steps = [-1, 0, 1];
  const around = steps
    .flatMap((z) => steps.flatMap((y) => steps.map((x) => x + m[0] * (y + m[1] * z))))
    .filter((step) => step < 0);
  const lower = (at: number, sign: number) => {
    let least = wide[at] - 1;
    for (let k = 0; k < around.length; k++) {
      const other = wide[at + sign * around[k]];
      if (other < least) least = other;
    }
    wide[at] = least + 1;
  };
  const result = new Uint8Array(cells.length);
  const rows: [number, number][] = [];
  for (let z = 0; z < n[2]; z++)
    for (let y = 0; y < n[1]; y++) rows.push([place(0, y, z), n[0] * (y + n[1] * z)]);
  for (const [to, from] of rows)
    for (let x = 0; x < n[0]; x++) {
      if (cells[from + x]) wide[to + x] = 0;
      else lower(to + x, 1);
    }
  for (const [to, from] of rows.reverse())
    for (let x = n[0] - 1; x >= 0; x--) {
      if (wide[to + x]) lower(to + x, -1);
      result[from + x] = wide[to + x];
    }
  return result;
}

export class Solid {
  readonly surface: Tape;
  private readonly point: Evaluator;
  private readonly ranges: Ranges;
  private readonly reading: Evaluator;
  /** Values of the tape's parameters. */
  readonly values: number[];

  constructor(readonly doc: ModelDoc) {
    const tape = Tape.of(doc.tape);
    const parts = doc.tape.results.length - 2;
    this.surface = tape.only(doc.tape.results.slice(0, parts));
    this.point = new Evaluator(this.surface);
    this.ranges = new Ranges(this.surface);
    this.reading = new Evaluator(tape.only(doc.tape.results.slice(parts)));
    this.values = [...doc.values];
    this.changed();
  }

  /** Updates the evaluators; must be called after a change of values. */
  changed(): void {
    this.point.set(this.values);
    this.ranges.set(this.values);
    this.reading.set(this.values);
  }

  /** Returns true if the parameters have their original values. */
  get isAsGiven(): boolean {
    return this.doc.values.every((v, i) => v === this.values[i]);
  }

  /** Returns the values of slots at a point. */
  at(p: V3, slots: number[]): number[] {
    for (let k = 0; k < 3; k++) this.point.coordinate(k)[0] = p[k];
    this.point.run(1);
    return slots.map((slot) => this.point.row(slot)[0]);
  }

  /** Returns the values of the first `n` points of the block, whose coordinates are set. */
  private joined(n: number): Float64Array {
    this.point.run(n);
    const stack: Float64Array[] = [];
    for (const step of this.doc.tree) {
      if (typeof step === "number") {
        stack.push(this.point.result(step).slice(0, n));
        continue;
      }
      const v = stack.pop()!;
      const u = stack[stack.length - 1];
      for (let i = 0; i < n; i++)
        u[i] = step === "min" ? Math.min(u[i], v[i]) : Math.max(u[i], v[i]);
    }
    return stack[0];
  }

  value(p: V3): number {
    for (let k = 0; k < 3; k++) this.point.coordinate(k)[0] = p[k];
    return this.joined(1)[0];
  }

  /** Classifies a box: 0 outside, 2 inside, 1 if it may contain surface. */
  private range(lo: V3, hi: V3): 0 | 1 | 2 {
    this.ranges.run(lo, hi);
    const stack: [number, number][] = [];
    for (const step of this.doc.tree) {
      if (typeof step === "number") {
        const slot = this.surface.results[step];
        stack.push([this.ranges.lo[slot], this.ranges.hi[slot]]);
        continue;
      }
      const [a, b] = stack.pop()!;
      const u = stack[stack.length - 1];
      const f = step === "min" ? Math.min : Math.max;
      u[0] = f(u[0], a);
      u[1] = f(u[1], b);
    }
    return stack[0][1] < 0 ? 0 : stack[0][0] > 0 ? 2 : 1;
  }

  /** Computes, for each point, the signed distance, positive inside, and the part that determines
   *  it. */
  read(points: ArrayLike<number>, each: (i: number, distance: number, part: number) => void): void {
    const n = points.length / 3;
    for (let from = 0; from < n; from += LANES) {
      const count = Math.min(LANES, n - from);
      for (let k = 0; k < 3; k++) {
        const row = this.reading.coordinate(k);
        for (let i = 0; i < count; i++) row[i] = points[3 * (from + i) + k];
      }
      this.reading.run(count);
      const [distance, part] = [this.reading.result(0), this.reading.result(1)];
      for (let i = 0; i < count; i++) each(from + i, distance[i], part[i]);
    }
  }

  /** Returns the name of the part at a point. */
  partAt(p: V3): string {
    let name = "";
    this.read(p, (_, __, part) => {
      name = this.doc.parts[part] ?? "";
    });
    return name;
  }

  /** Returns the first change of sign along a ray between two distances. */
  meet(o: V3, d: V3, from: number, to: number): number | null {
    const finest = (to - from) * FINEST;
    const segments: [number, number][] = [[from, to]];
    for (let k = 0; k < MOST_SEGMENTS; k++) {
      const segment = segments.pop();
      if (!segment) return null;
      const [a, b] = segment;
      const { lo, hi } = box([along(o, d, a), along(o, d, b)]);
      if (this.range(lo, hi) !== 1) continue;
      if (b - a > finest) {
        const m = 0.5 * (a + b);
        segments.push([m, b], [a, m]);
        continue;
      }
      const isInside = this.value(along(o, d, a)) >= 0;
      if (isInside !== this.value(along(o, d, b)) >= 0) return this.bisected(o, d, a, b, isInside);
    }
    return null;
  }

  private bisected(o: V3, d: V3, from: number, to: number, isInside: boolean): number {
    let [a, b] = [from, to];
    for (let k = 0; k < 60; k++) {
      const m = 0.5 * (a + b);
      if (m <= a || m >= b) break;
      if (this.value(along(o, d, m)) >= 0 === isInside) a = m;
      else b = m;
    }
    return 0.5 * (a + b);
  }

  /** Returns the cells of a grid that may contain surface: the grid is halved as long as ranges do
   *  not decide. */
  private cells(at: Box, n: V3): Uint8Array {
    const cells = new Uint8Array(n[0] * n[1] * n[2]);
    const place = (k: number, i: number) => at.lo[k] + (at.hi[k] - at.lo[k]) * (i / n[k]);
    const blocks: [V3, V3][] = [[[0, 0, 0], [...n]]];
    for (let block = blocks.pop(); block; block = blocks.pop()) {
      const [from, to] = block;
      const lo: V3 = [place(0, from[0]), place(1, from[1]), place(2, from[2])];
      const hi: V3 = [place(0, to[0]), place(1, to[1]), place(2, to[2])];
      if (this.range(lo, hi) !== 1) continue;
      const size = [0, 1, 2].map((k) => to[k] - from[k]);
      const axis = size.indexOf(Math.max(...size));
      if (size[axis] === 1) {
        cells[from[0] + n[0] * (from[1] + n[1] * from[2])] = 1;
        continue;
      }
      const middle = from[axis] + (size[axis] >> 1);
      const [first, second]: [V3, V3] = [[...to], [...from]];
      first[axis] = second[axis] = middle;
      blocks.push([from, first], [second, to]);
    }
    return cells;
  }

  /** Returns the box of the cells that are set, and true if one of them lies at the border of the
   *  grid. */
  private used(at: Box, n: V3, cells: Uint8Array): { box: Box; isAtBorder: boolean } | null {
    const lo = [...n];
    const hi = [-1, -1, -1];
    cells.forEach((cell, i) => {
      if (!cell) return;
      const place = [i % n[0], Math.floor(i / n[0]) % n[1], Math.floor(i / n[0] / n[1])];
      for (let k = 0; k < 3; k++) {
        lo[k] = Math.min(lo[k], place[k]);
        hi[k] = Math.max(hi[k], place[k]);
      }
    });
    if (hi[0] < 0) return null;
    const place = (k: number, i: number) => at.lo[k] + (at.hi[k] - at.lo[k]) * (i / n[k]);
    const isAtBorder = [0, 1, 2].some((k) => lo[k] === 0 || hi[k] === n[k] - 1);
    return {
      box: {
        lo: [0, 1, 2].map((k) => place(k, lo[k])) as V3,
        hi: [0, 1, 2].map((k) => place(k, hi[k] + 1)) as V3,
      },
      isAtBorder,
    };
  }

  /** Returns the grid of the surface for the current values; null if there is no surface. */
  brick(): Brick | null {
    const found = this.doc.isCut
      ? { lo: this.doc.bounds[0], hi: this.doc.bounds[1] }
      : this.extent();
    if (!found) return null;
    const steps = this.surface.steps.length;
    const most = steps < 80 ? 48 : steps < 400 ? 32 : 20;
    const size = [0, 1, 2].map((k) => found.hi[k] - found.lo[k]);
    const cell = Math.max(...size) / most;
    const n = size.map((s) => Math.max(1, Math.min(most, Math.ceil(s / cell)))) as V3;
    return { box: found, n, cells: this.cells(found, n) };
  }

  /** Returns a box of the surface: the original one, or one that grows while it is too small and
   *  shrinks while that reduces it. */
  private extent(): Box | null {
    const [lo, hi] = this.doc.bounds;
    if (this.isAsGiven && !this.doc.isLoose) return { lo, hi };
    const middle = add(lo, hi).map((v) => v / 2) as V3;
    let half = REACH * 0.5 * Math.max(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]);
    let at: Box | null = null;
    for (let k = 0; k <= GROWTHS; k++, half *= 2) {
      const region = inBox(middle, half);
      const found = this.used(region, SEARCH, this.cells(region, SEARCH));
      at = found?.box ?? null;
      if (found && !found.isAtBorder) break;
      if (found && k === GROWTHS)
        return inBox(middle, REACH * 0.5 * Math.max(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]));
    }
    for (let k = 0; at && k < SHRINKS; k++) {
      const before = diagonal(at);
      at = this.used(at, SEARCH, this.cells(at, SEARCH))?.box ?? null;
      if (at && diagonal(at) > 0.97 * before) break;
    }
    return at;
  }
}

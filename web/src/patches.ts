// Rational patches, evaluated from their control points.

import { Group } from "three";
import * as bytes from "./bytes";
import { focusedColor, partColor, roundUp, scaleColor } from "./colors";
import {
  chosen,
  type ColorMode,
  type Extra,
  type Hit,
  type Layer,
  type Look,
  type Ray,
  type Scale,
  type Section,
} from "./layer";
import { type Lines, segments, showLines } from "./lines";
import type { PatchesDoc } from "./scene";
import { planeOf } from "./shaders";
import { Surface } from "./triangles";
import { type Box, add, along, cross, diagonal, dot, scale, sub, type V3 } from "./vector";

/** Number of chequers along each side of a patch. */
const CHEQUERS = 8;
/** Number of segments of a line of constant u or v. */
const LINE = 32;
/** Maximum number of Newton steps from a triangle to the patch itself. */
const STEPS = 8;

/** Distance, as a fraction of the whole, by which coincident patches are drawn apart, and the
 *  number of patches that are distinguished. */
const NEARER = 1e-3;
const RANKS = 13;

export interface Tangents {
  point: V3;
  u: V3;
  v: V3;
}

/** Returns the Bernstein polynomials and their derivatives. */
function bernstein(n: number, t: number): [number[], number[]] {
  const of = (n: number): number[] => {
    const b = [1];
    for (let k = 1; k <= n; k++) {
      b[k] = t * b[k - 1];
      for (let i = k - 1; i > 0; i--) b[i] = (1 - t) * b[i] + t * b[i - 1];
      b[0] *= 1 - t;
    }
    return b;
  };
  const low = of(n - 1);
  return [of(n), of(n).map((_, i) => n * ((low[i - 1] ?? 0) - (low[i] ?? 0)))];
}

/** Returns the quotient of a homogeneous point, with its derivatives. */
export function quotient(h: number[], hu: number[], hv: number[]): Tangents {
  const point = scale(h, 1 / h[3]);
  const slope = (d: number[]): V3 => scale(sub(d, scale(point, d[3])), 1 / h[3]);
  return { point, u: slope(hu), v: slope(hv) };
}

/** Moves a point of a surface onto a ray, by Newton's method for o + t d = p(u, v). */
export function ontoRay(
  at: (u: number, v: number) => Tangents,
  o: V3,
  d: V3,
  start: [number, number],
): [number, number, Tangents] {
  let [u, v] = start;
  let now = at(u, v);
  for (let k = 0; k < STEPS; k++) {
    const r = sub(now.point, o);
    // The component of r across the ray must vanish: r + u' du + v' dv is parallel to d.
    const n = cross(now.u, now.v);
    const det = dot(n, d);
    if (Math.abs(det) < 1e-300) break;
    const t = dot(n, r) / det;
    const miss = sub(along(o, d, t), now.point);
    const [g11, g12, g22] = [dot(now.u, now.u), dot(now.u, now.v), dot(now.v, now.v)];
    const [a, b, g] = [dot(miss, now.u), dot(miss, now.v), g11 * g22 - g12 * g12];
    if (!(g > 0)) break;
    const [du, dv] = [(g22 * a - g12 * b) / g, (g11 * b - g12 * a) / g];
    u += du;
    v += dv;
    now = at(u, v);
    if (Math.abs(du) + Math.abs(dv) < 1e-13) break;
  }
  return [u, v, now];
}

class Patch {
  constructor(
    readonly name: string,
    readonly m: number,
    readonly n: number,
    readonly distance: number | null,
    private readonly control: Float64Array,
  ) {}

  /** Returns the edges of the control net as pairs of points, without those at infinity. */
  net(): V3[] {
    const { m, n, control } = this;
    const point = (i: number, j: number): V3 => {
      const c = control.subarray(4 * (i * (n + 1) + j), 4 * (i * (n + 1) + j) + 4);
      return scale(c, 1 / c[3]);
    };
    const pairs: V3[] = [];
    const leg = (p: V3, q: V3) => {
      if (p.every(Number.isFinite) && q.every(Number.isFinite)) pairs.push(p, q);
    };
    for (let i = 0; i <= m; i++)
      for (let j = 0; j <= n; j++) {
        if (i < m) leg(point(i, j), point(i + 1, j));
        if (j < n) leg(point(i, j), point(i, j + 1));
      }
    return pairs;
  }

  /** Returns lines of constant u and v as pairs of points. */
  isolines(): V3[] {
    const pairs: V3[] = [];
    for (let k = 0; k <= CHEQUERS; k++)
      for (let i = 0; i < LINE; i++) {
        const [a, b, c] = [k / CHEQUERS, i / LINE, (i + 1) / LINE];
        pairs.push(
          this.at(a, b).point,
          this.at(a, c).point,
          this.at(b, a).point,
          this.at(c, a).point,
        );
      }
    return pairs;
  }

  at(u: number, v: number): Tangents {
    const [a, da] = bernstein(this.m, u);
    const [b, db] = bernstein(this.n, v);
    const sum = (p: number[], q: number[]) => {
      const h = [0, 0, 0, 0];
      for (let i = 0; i <= this.m; i++)
        for (let j = 0; j <= this.n; j++)
          for (let c = 0; c < 4; c++)
            h[c] += p[i] * q[j] * this.control[4 * (i * (this.n + 1) + j) + c];
      return h;
    };
    return quotient(sum(a, b), sum(da, b), sum(a, db));
  }
}

export class PatchesLayer implements Layer {
  readonly kind = "patches";
  visible = true;
  opacity = 1;
  colorBy: ColorMode = "part";
  focus: Set<number> | null = null;
  readonly modes: ColorMode[] = ["none", "part", "u", "v"];
  readonly extras: Extra[] = [
    { key: "nets", name: "Control nets", isSlider: false, value: 0 },
    { key: "lines", name: "Lines of u and v", isSlider: false, value: 0 },
  ];
  readonly object = new Group();
  private readonly surface: Surface;
  private readonly nets: Lines;
  private readonly isolines: Lines;
  private painted = "";
  private limits: Scale | null = null;
  /** Number of squares along each side of a patch, and parameters u and v of all corners. */
  private readonly squares: number;
  private readonly parameters: Float32Array;

  private constructor(
    readonly id: string,
    private readonly doc: PatchesDoc,
    private readonly patches: Patch[],
    private readonly origin: V3,
  ) {
    this.squares = patches.length > 400 ? 8 : patches.length > 80 ? 16 : 32;
    const { squares } = this;
    const side = squares + 1;
    const points = new Float64Array(3 * side * side * patches.length);
    const normals = new Float64Array(points.length);
    const triangles = new Uint32Array(6 * squares * squares * patches.length);
    let at = 0;
    patches.forEach((patch, k) => {
      const first = k * side * side;
      for (let i = 0; i < side; i++)
        for (let j = 0; j < side; j++) {
          const t = patch.at(i / squares, j / squares);
          points.set(t.point, 3 * (first + i * side + j));
          normals.set(cross(t.u, t.v), 3 * (first + i * side + j));
        }
      for (let i = 0; i < squares; i++)
        for (let j = 0; j < squares; j++) {
          const [a, b, c, d] = [
            first + i * side + j,
            first + (i + 1) * side + j,
            first + (i + 1) * side + j + 1,
            first + i * side + j + 1,
          ];
          triangles.set([a, b, c, a, c, d], at);
          at += 6;
        }
    });
    const slopes = new Float32Array(3 * triangles.length);
    this.parameters = new Float32Array(2 * triangles.length);
    triangles.forEach((node, i) => {
      slopes.set(normals.subarray(3 * node, 3 * node + 3), 3 * i);
      const place = node % (side * side);
      this.parameters.set([Math.floor(place / side) / squares, (place % side) / squares], 2 * i);
    });
    this.surface = new Surface(points, triangles, origin, slopes);
    const inScene = (pairs: V3[]) => Float32Array.from(pairs.flatMap((p) => sub(p, origin)));
    this.nets = segments(inScene(patches.flatMap((p) => p.net())), [200, 60, 40]);
    this.isolines = segments(inScene(patches.flatMap((p) => p.isolines())), [30, 36, 44]);
    this.object.add(this.surface.object, this.nets, this.isolines);
    // Patches of a cover overlap and differ there by less than their triangles deviate from them.
    this.surface.rank(
      (corner) => this.patchOf(Math.floor(corner / 3)) % RANKS,
      NEARER * diagonal(this.bounds()),
    );
    if (patches.some((p) => p.distance !== null)) this.modes.push("bound");
  }

  static async of(id: string, doc: PatchesDoc, origin: V3): Promise<PatchesLayer> {
    const control = await bytes.f64(doc.control);
    let from = 0;
    const patches = doc.patches.map(({ name, degree: [m, n], distance }) => {
      const count = 4 * (m + 1) * (n + 1);
      from += count;
      return new Patch(name, m, n, distance, control.subarray(from - count, from));
    });
    return new PatchesLayer(id, doc, patches, origin);
  }

  get name(): string {
    return this.doc.name;
  }
  get count(): number {
    return this.patches.length;
  }
  bounds(): Box {
    return { lo: this.doc.bounds[0], hi: this.doc.bounds[1] };
  }
  private patchOf(triangle: number): number {
    return Math.floor(triangle / (2 * this.squares * this.squares));
  }

  /** Colours a patch in light and dark squares. */
  private chequered(corner: number, color: ArrayLike<number>): number[] {
    const square = Math.floor(corner / 6) % (this.squares * this.squares);
    const each = this.squares / CHEQUERS;
    const isDark =
      (Math.floor(Math.floor(square / this.squares) / each) +
        Math.floor((square % this.squares) / each)) %
      2;
    return [0, 1, 2].map((k) => Math.round(isDark ? 0.78 * color[k] : color[k]));
  }

  private paint(): void {
    const painted = `${this.colorBy} ${[...(this.focus ?? [])]}`;
    if (this.painted === painted) return;
    this.painted = painted;
    this.limits = null;
    const { surface, patches } = this;
    if (this.colorBy === "u" || this.colorBy === "v") {
      const k = this.colorBy === "u" ? 0 : 1;
      this.limits = {
        title: this.colorBy,
        lower: 0,
        upper: 1,
        isDiverging: false,
        n: patches.length,
        rms: NaN,
        max: NaN,
      };
      surface.paint((corner) => scaleColor(this.parameters[2 * corner + k], 0, 1, false));
    } else if (this.colorBy === "bound") {
      const all = patches.map((p) => p.distance ?? NaN);
      const known = all.filter(Number.isFinite);
      const upper = roundUp(known.reduce((m, v) => Math.max(m, v), 0));
      this.limits = {
        title: "bound on the distance",
        lower: 0,
        upper,
        isDiverging: false,
        n: known.length,
        rms: NaN,
        max: known.reduce((m, v) => Math.max(m, v), 0),
      };
      surface.paint((corner) =>
        scaleColor(all[this.patchOf(Math.floor(corner / 3))], 0, upper, false),
      );
    } else {
      const isPart = this.colorBy === "part";
      surface.paint((corner) => {
        const color = focusedColor(this.patchOf(Math.floor(corner / 3)), this.focus);
        return this.chequered(corner, isPart ? color : [176, 186, 200]);
      });
    }
  }

  legend(): [string, string][] {
    if (this.colorBy !== "part") return [];
    return this.patches.map((p, i) => [p.name, `rgb(${partColor(i)})`]);
  }
  scale(): Scale | null {
    return this.limits;
  }

  update(section: Section | null, look: Look): void {
    if (!this.modes.includes(this.colorBy)) this.colorBy = "none";
    this.paint();
    this.surface.update(this.visible, this.opacity, false, section, look);
    const plane = planeOf(section, this.origin);
    showLines(this.nets, this.visible && chosen(this.extras, "nets") === 1, plane);
    showLines(this.isolines, this.visible && chosen(this.extras, "lines") === 1, plane);
  }

  pick(ray: Ray): Hit | null {
    const found = this.surface.meet(ray);
    if (!found) return null;
    const k = this.patchOf(found.triangle);
    const corner = (c: number, i: number) => this.parameters[2 * (3 * found.triangle + c) + i];
    const place = [0, 1].map(
      (i) =>
        corner(0, i) +
        found.u * (corner(1, i) - corner(0, i)) +
        found.v * (corner(2, i) - corner(0, i)),
    ) as [number, number];
    const [u, v, there] = ontoRay((u, v) => this.patches[k].at(u, v), ray.o, ray.d, place);
    // At an edge the ray may miss the patch by less than its triangles deviate from it.
    const isOn = u >= 0 && u <= 1 && v >= 0 && v <= 1;
    const parameter: [number, number] = isOn ? [u, v] : place;
    const point = isOn ? there.point : this.patches[k].at(...place).point;
    return {
      t: dot(sub(point, ray.o), ray.d),
      point: add(point, [0, 0, 0]),
      part: this.patches[k].name,
      parameter,
    };
  }
}

// Rational maps: triangles in space and in the parameter plane, and the map itself between them.

import { Group } from "three";
import * as bytes from "./bytes";
import { scaleColor } from "./colors";
import type { ColorMode, Hit, Layer, Look, Ray, Scale, Section } from "./layer";
import { type Lines, segments, showLines } from "./lines";
import { ontoRay, quotient, type Tangents } from "./patches";
import type { MapDoc } from "./scene";
import { planeOf } from "./shaders";
import { Surface } from "./triangles";
import { type Box, along, cross, dot, scale, sub, unit, type V3 } from "./vector";

/** Signs of s and t in the four unit triangles of the parameter plane. */
export const QUADRANTS = [
  [1, 1],
  [-1, 1],
  [-1, -1],
  [1, -1],
];
/** Colours of the four triangles, equal to those of the parameter pane. */
export const CHARTS: [number, number, number][] = [
  [150, 190, 225],
  [238, 190, 130],
  [150, 200, 160],
  [205, 165, 205],
];

/** Maximum distance of the double curve from a picked pixel, in pixels. */
const REACH = 9;
/** Maximum number of Newton steps. */
const STEPS = 12;
/** Sine of the angle between parameters (s : t : w) above which they are distinct. */
const APART = 1e-4;

export class MapLayer implements Layer {
  readonly kind = "map";
  visible = true;
  opacity = 1;
  colorBy: ColorMode = "none";
  readonly modes: ColorMode[] = ["none", "part", "u", "v"];
  readonly object = new Group();
  private readonly surface: Surface;
  private readonly curves: Lines[] = [];
  private painted = "";
  private limits: Scale | null = null;

  private constructor(
    readonly id: string,
    readonly doc: MapDoc,
    points: Float64Array,
    triangles: Uint32Array,
    readonly charts: Uint8Array,
    /** Parameters u and v of the three corners of each triangle. */
    readonly corners: Float32Array,
    private readonly origin: V3,
  ) {
    const slopes = new Float32Array(3 * triangles.length);
    for (let i = 0; i < triangles.length; i++)
      slopes.set(this.slope(charts[Math.floor(i / 3)], corners[2 * i], corners[2 * i + 1]), 3 * i);
    this.surface = new Surface(points, triangles, origin, slopes);
    this.object.add(this.surface.object);
    this.draw(doc.double, [209, 73, 91], false);
    this.draw(doc.solitary, [209, 73, 91], true);
  }

  static async of(id: string, doc: MapDoc, origin: V3): Promise<MapLayer> {
    const points = bytes.doubles(await bytes.coordinates(doc.positions));
    const [triangles, charts] = [await bytes.u32(doc.triangles), await bytes.u8(doc.charts)];
    return new MapLayer(id, doc, points, triangles, charts, await bytes.f32(doc.corners), origin);
  }

  get name(): string {
    return this.doc.name;
  }
  get note(): string {
    const { double, solitary, basePoints, isCertified } = this.doc;
    const signs = ["outline: where the drawn surface ends"];
    if (double.length) signs.push("red: double curve");
    if (solitary.length) signs.push("dashed: solitary arc");
    if (basePoints.length) signs.push("ring: base point");
    return `${signs.join("; ")}. ${isCertified ? "Certified." : "Not everything is proved."}`;
  }
  get count(): number {
    return this.doc.count;
  }
  get triangles(): Uint32Array {
    return this.surface.triangles;
  }
  bounds(): Box {
    return { lo: this.doc.positions.lo, hi: this.doc.positions.hi };
  }

  private draw(arcs: V3[][], color: [number, number, number], isDashed: boolean): void {
    const pairs = arcs.flatMap((arc) =>
      arc.slice(1).flatMap((p, i) => [...sub(arc[i], this.origin), ...sub(p, this.origin)]),
    );
    if (!pairs.length) return;
    const lines = segments(Float32Array.from(pairs), color, isDashed ? this.doc.halfWidth / 40 : 0);
    this.curves.push(lines);
    this.object.add(lines);
  }

  /** Returns the homogeneous parameters (s : t : w) of a point of a unit triangle. */
  homogeneous(chart: number, u: number, v: number): V3 {
    const [s, t] = QUADRANTS[chart];
    const h: V3 = [s * u, t * v, 1 - u - v];
    const { frame } = this.doc;
    return frame ? (frame.map((row) => dot(row, h)) as V3) : h;
  }

  parameter(chart: number, u: number, v: number): [number, number] {
    const [s, t, w] = this.homogeneous(chart, u, v);
    return [s / w, t / w];
  }

  /** Evaluates the four forms at (s : t : w), with their three derivatives. */
  private forms([s, t, w]: V3): number[][] {
    const d = this.doc.degree;
    return this.doc.forms.map((terms) => {
      const sum = [0, 0, 0, 0];
      for (const [i, j, c] of terms) {
        const k = d - i - j;
        const [p, q, r] = [s ** i, t ** j, w ** k];
        sum[0] += c * p * q * r;
        if (i) sum[1] += c * i * s ** (i - 1) * q * r;
        if (j) sum[2] += c * j * p * t ** (j - 1) * r;
        if (k) sum[3] += c * k * p * q * w ** (k - 1);
      }
      return sum;
    });
  }

  /** Returns the point with given parameters of a unit triangle, and its derivatives by u and v. */
  at(chart: number, u: number, v: number): Tangents {
    const forms = this.forms(this.homogeneous(chart, u, v));
    // (s : t : w) is linear in u and v.
    const base = this.homogeneous(chart, 0, 0);
    const alongU = sub(this.homogeneous(chart, 1, 0), base);
    const alongV = sub(this.homogeneous(chart, 0, 1), base);
    const by = (way: V3) => forms.map((f) => f[1] * way[0] + f[2] * way[1] + f[3] * way[2]);
    return quotient(
      forms.map((f) => f[0]),
      by(alongU),
      by(alongV),
    );
  }

  /** Returns a normal of the surface; zero if it has none. */
  private slope(chart: number, u: number, v: number): V3 {
    const there = this.at(chart, u, v);
    const n = cross(there.u, there.v);
    const size = Math.hypot(...n);
    return size > 0 && Number.isFinite(size) ? [n[0] / size, n[1] / size, n[2] / size] : [0, 0, 0];
  }

  /** Returns true if a point lies in the box in which the surface is drawn. */
  isInBox(p: V3): boolean {
    return p.every((v) => Math.abs(v) <= this.doc.halfWidth * (1 + 1e-9));
  }

  private paint(): void {
    if (this.painted === this.colorBy) return;
    this.painted = this.colorBy;
    this.limits = null;
    const chart = (corner: number) => this.charts[Math.floor(corner / 3)];
    if (this.colorBy === "u" || this.colorBy === "v") {
      const k = this.colorBy === "u" ? 0 : 1;
      this.limits = {
        title: `${this.colorBy} of the unit triangles`,
        lower: 0,
        upper: 1,
        isDiverging: false,
        n: this.count,
        rms: NaN,
        max: NaN,
      };
      this.surface.paint((corner) => scaleColor(this.corners[2 * corner + k], 0, 1, false));
    } else if (this.colorBy === "part") this.surface.paint((corner) => CHARTS[chart(corner)]);
    else this.surface.paint(() => [150, 178, 205]);
  }

  legend(): [string, string][] {
    if (this.colorBy !== "part") return [];
    return QUADRANTS.map(([s, t], i) => [
      `s ${s > 0 ? "≥" : "≤"} 0, t ${t > 0 ? "≥" : "≤"} 0`,
      `rgb(${CHARTS[i]})`,
    ]);
  }
  scale(): Scale | null {
    return this.limits;
  }

  update(section: Section | null, look: Look): void {
    if (!this.modes.includes(this.colorBy)) this.colorBy = "none";
    this.paint();
    this.surface.update(this.visible, this.opacity, false, section, look);
    this.object.visible = this.visible;
    for (const lines of this.curves) showLines(lines, true, planeOf(section, this.origin));
  }

  pick(ray: Ray): Hit | null {
    const found = this.surface.meet(ray);
    if (!found) return null;
    const chart = this.charts[found.triangle];
    const corner = (c: number, i: number) => this.corners[6 * found.triangle + 2 * c + i];
    const place = [0, 1].map(
      (i) =>
        corner(0, i) +
        found.u * (corner(1, i) - corner(0, i)) +
        found.v * (corner(2, i) - corner(0, i)),
    ) as [number, number];
    const flat = along(ray.o, ray.d, found.t);
    const [u, v, there] = ontoRay((u, v) => this.at(chart, u, v), ray.o, ray.d, place);
    const isNear =
      there.point.every(Number.isFinite) &&
      Math.hypot(...sub(there.point, flat)) < 0.05 * this.doc.halfWidth;
    const at: [number, number] = isNear ? [u, v] : place;
    const point = isNear ? there.point : this.at(chart, ...place).point;
    const isUsable =
      point.every(Number.isFinite) && Math.hypot(...sub(point, flat)) < 0.05 * this.doc.halfWidth;
    return { t: found.t, point: isUsable ? point : flat, parameter: this.parameter(chart, ...at) };
  }

  /** Returns the point of a parameter that is picked in the parameter plane; null outside of the
   *  box. */
  hit(chart: number, u: number, v: number): Hit | null {
    const { point } = this.at(chart, u, v);
    const parameter = this.parameter(chart, u, v);
    if (!point.every(Number.isFinite) || !parameter.every(Number.isFinite) || !this.isInBox(point))
      return null;
    return { t: 0, point, parameter };
  }

  /** Returns the vertex of the double curve nearest to a pixel; null if all are too far away. */
  nearDouble(ray: Ray): V3 | null {
    let [best, least]: [V3 | null, number] = [null, REACH];
    for (const p of this.doc.double.flat()) {
      const [x, y, depth] = ray.project(p);
      const away = Math.hypot(x - ray.pixel[0], y - ray.pixel[1]);
      if (away < least && depth > ray.from) [best, least] = [p, away];
    }
    return best;
  }

  /** Returns all parameters (s : t : w), of length 1 and with w ≥ 0, of a point of the surface:
   *  Newton's method from each triangle near it. */
  preimages(p: V3): V3[] {
    const size = this.doc.halfWidth;
    const { points, triangles } = this.surface;
    const found: V3[] = [];
    for (let i = 0; i < this.count; i++) {
      const isNear = [0, 1, 2].every((k) => {
        const ends = [0, 1, 2].map((c) => points[3 * triangles[3 * i + c] + k]);
        return Math.min(...ends) <= p[k] + 1e-3 * size && Math.max(...ends) >= p[k] - 1e-3 * size;
      });
      if (!isNear) continue;
      const middle = [0, 1].map(
        (k) =>
          (this.corners[6 * i + k] + this.corners[6 * i + 2 + k] + this.corners[6 * i + 4 + k]) / 3,
      );
      const place = this.foot(this.charts[i], middle[0], middle[1], p);
      const isNew = place && found.every((q) => Math.hypot(...cross(q, place)) > APART);
      if (isNew) found.push(place);
    }
    return found;
  }

  /** Returns the parameters of a point, by Newton's method from parameters nearby; null if it does
   *  not converge. */
  private foot(chart: number, u: number, v: number, p: V3): V3 | null {
    for (let k = 0; k < STEPS; k++) {
      const there = this.at(chart, u, v);
      const miss = sub(p, there.point);
      if (Math.hypot(...miss) < 1e-9 * this.doc.halfWidth) {
        const place = unit(this.homogeneous(chart, u, v));
        return place[2] < 0 ? scale(place, -1) : place;
      }
      const [g11, g12, g22] = [dot(there.u, there.u), dot(there.u, there.v), dot(there.v, there.v)];
      const [a, b, g] = [dot(miss, there.u), dot(miss, there.v), g11 * g22 - g12 * g12];
      if (!(g > 0)) return null;
      u += (g22 * a - g12 * b) / g;
      v += (g11 * b - g12 * a) / g;
    }
    return null;
  }

  /** Returns the unit triangle that contains a parameter point, with u and v there. */
  chartOf([s, t]: [number, number]): [number, number, number] {
    let h: V3 = [s, t, 1];
    const { frame } = this.doc;
    if (frame) {
      // The frame is upper triangular.
      const w = 1 / frame[2][2];
      const y = (t - frame[1][2] * w) / frame[1][1];
      h = [(s - frame[0][1] * y - frame[0][2] * w) / frame[0][0], y, w];
    }
    if (h[2] < 0) h = [-h[0], -h[1], -h[2]];
    const sum = Math.abs(h[0]) + Math.abs(h[1]) + h[2];
    const chart = QUADRANTS.findIndex(([a, b]) => a * h[0] >= 0 && b * h[1] >= 0);
    return [Math.max(0, chart), Math.abs(h[0]) / sum, Math.abs(h[1]) / sum];
  }
}

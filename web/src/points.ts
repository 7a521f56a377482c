// Points, drawn as discs of a few pixels.

import {
  BufferAttribute,
  BufferGeometry,
  GLSL3,
  Points,
  ShaderMaterial,
  Vector3,
  Vector4,
} from "three";
import * as bytes from "./bytes";
import { css, focusedColor, PALE, partColor, roundUp, scaleColor, share } from "./colors";
import type { ColorMode, Hit, Layer, Look, Ray, Scale, Section } from "./layer";
import type { PointsDoc } from "./scene";
import { planeOf } from "./shaders";
import { type Box, dot, norm, sub, type V3 } from "./vector";

/** Maximum distance of a picked point from the pixel, in pixels. */
const REACH = 6;
/** Fraction of the sorted deviations that lie within the ends of the scale. */
const WITHIN = 0.95;
/** Number of steps of a histogram; it is odd, so that the middle one is about zero. */
const STEPS = 41;
const OUTLIER: [number, number, number] = [96, 96, 102];
/** Colour of selected points. */
const SELECTED: [number, number, number] = [230, 0, 126];

/** Distance by which points are drawn nearer, as a fraction of their distance or of the whole. */
const NEARER = 0.002;

const VERTEX = `
#define NEARER ${NEARER}
uniform bool isFlat;
uniform float nearer;
uniform vec3 first;
uniform vec3 unit;
in vec3 tint;
uniform float size;
uniform float dot_size;
uniform vec3 pale;
uniform vec4 plane;
uniform bool isTinted;
uniform vec3 color;
flat out vec3 paint;
void main() {
  vec3 p = first + unit * position;
  paint = isTinted ? tint : color;
  // Points out of focus are small, so that they do not hide those in focus.
  bool isPale = isTinted && all(lessThan(abs(tint - pale), vec3(1e-3)));
  gl_PointSize = isPale ? min(size, dot_size) : size;
  // Points on a surface are to be seen before it.
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  if (isFlat) seen.z += nearer; else seen.xyz *= 1.0 - NEARER;
  bool isAway = dot(plane.xyz, p) > plane.w;
  gl_Position = isAway ? vec4(2.0, 2.0, 2.0, 1.0) : projectionMatrix * seen;
}
`;
const FRAGMENT = `
precision mediump float;
flat in vec3 paint;
uniform float opacity;
uniform bool isRound;
out vec4 outColor;
void main() {
  vec2 q = 2.0 * gl_PointCoord - 1.0;
  if (isRound && dot(q, q) > 1.0) discard;
  outColor = vec4(paint, opacity);
}
`;

export class PointsLayer implements Layer {
  readonly kind = "points";
  visible = true;
  opacity = 1;
  colorBy: ColorMode = "none";
  readonly object: Points<BufferGeometry, ShaderMaterial>;
  /** Deviations from a model of the scene, which replace those of the file. */
  private measured: Float32Array | null = null;
  private limits: Scale | null = null;
  private tinted = "";
  focus: Set<number> | null = null;
  /** Value 1 for selected points; null if none is. */
  private selected: Uint8Array | null = null;
  private turn = 0;

  private constructor(
    readonly id: string,
    private readonly doc: PointsDoc,
    private readonly coordinates: bytes.Coordinates,
    private readonly given: Float32Array | null,
    private readonly colors: Uint8Array | null,
    /** Value 1 for points that no statistics count. */
    private readonly outliers: Uint8Array | null,
    /** Entity of each point plus 1; 0 for points of none. */
    readonly entities: Uint16Array | null,
    private readonly origin: V3,
  ) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(coordinates.array, 3, false));
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: {
        size: { value: 3 },
        dot_size: { value: 1 },
        pale: { value: new Vector3(...share(PALE)) },
        plane: { value: new Vector4(0, 0, 0, 1) },
        isTinted: { value: false },
        isRound: { value: true },
        color: { value: new Vector3() },
        opacity: { value: 1 },
        isFlat: { value: false },
        first: { value: new Vector3(...sub(coordinates.from, origin)) },
        unit: { value: new Vector3(...(coordinates.step as V3)) },
        nearer: { value: NEARER * norm(sub(coordinates.hi, coordinates.lo)) },
      },
    });
    this.object = new Points(geometry, material);
    this.object.frustumCulled = false;
    this.object.onBeforeRender = (_r, _s, camera) => {
      material.uniforms.isFlat.value = "isOrthographicCamera" in camera;
      material.uniformsNeedUpdate = true;
    };
    this.object.scale.set(...(coordinates.step as V3));
    this.object.position.set(...sub(coordinates.from, origin));
    if (this.colors) this.colorBy = "file";
    if (this.entities) this.colorBy = "part";
  }

  static async of(id: string, doc: PointsDoc, origin: V3): Promise<PointsLayer> {
    const coordinates = await bytes.coordinates(doc.positions);
    const deviation = doc.deviation ? await bytes.numbers(doc.deviation) : null;
    const colors = doc.colors ? await bytes.u8(doc.colors) : null;
    const outliers = doc.outliers ? await bytes.u8(doc.outliers) : null;
    const entities = doc.entities ? await bytes.u16(doc.entities) : null;
    return new PointsLayer(id, doc, coordinates, deviation, colors, outliers, entities, origin);
  }

  get name(): string {
    return this.doc.name;
  }
  get count(): number {
    return this.doc.count;
  }
  get deviation(): Float32Array | null {
    return this.measured ?? this.given;
  }
  get hasOwnDeviation(): boolean {
    return this.given !== null;
  }
  get modes(): ColorMode[] {
    const modes: ColorMode[] = ["none"];
    if (this.deviation) modes.push("deviation");
    if (this.colors) modes.push("file");
    if (this.entities) modes.push("part");
    return modes;
  }

  /** Returns the coordinates of all points in double precision. */
  positions(): Float64Array {
    return bytes.doubles(this.coordinates);
  }

  /** Sets the deviations from a model, or returns to those of the file. */
  measure(values: Float32Array | null): void {
    this.measured = values;
    this.limits = null;
    this.tinted = "";
  }

  scale(): Scale | null {
    const values = this.deviation;
    if (this.colorBy !== "deviation" || !values) return null;
    if (!this.limits) {
      const counted = this.outliers ? values.filter((_, i) => !this.outliers![i]) : values;
      this.limits = {
        ...scaleOf(counted, this.measured ? undefined : this.doc.limit),
        left: values.length - counted.length,
      };
    }
    return this.limits;
  }
  legend(): [string, string][] {
    if (this.colorBy !== "part" || !this.entities) return [];
    const last = this.entities.reduce((a, b) => Math.max(a, b), 0);
    return Array.from({ length: last }, (_, i) => [`face ${i}`, css(partColor(i))]);
  }

  /** Selects points; null selects none. */
  select(selected: Uint8Array | null): void {
    this.selected = selected;
    this.turn += 1;
  }
  bounds(): Box | null {
    return this.count ? { lo: this.coordinates.lo as V3, hi: this.coordinates.hi as V3 } : null;
  }

  private tint(): void {
    const tinted = `${this.colorBy} ${this.turn} ${[...(this.focus ?? [])]}`;
    if (this.tinted === tinted) return;
    this.tinted = tinted;
    const { geometry } = this.object;
    if (!this.isTinted) {
      geometry.deleteAttribute("tint");
      return;
    }
    let tints = this.colors;
    const scale = this.scale();
    if (scale) {
      tints = new Uint8Array(3 * this.count);
      const color = (v: number, i: number) =>
        this.outliers?.[i] ? OUTLIER : scaleColor(v, scale.lower, scale.upper, true);
      this.deviation!.forEach((v, i) => tints!.set(color(v, i), 3 * i));
    } else if (this.colorBy === "part" && this.entities) {
      const last = this.entities.reduce((a, b) => Math.max(a, b), 0);
      const colors = Array.from({ length: last + 1 }, (_, i) =>
        i ? focusedColor(i - 1, this.focus) : OUTLIER,
      );
      tints = new Uint8Array(3 * this.count);
      this.entities.forEach((entity, i) => tints!.set(colors[entity], 3 * i));
    } else if (this.colorBy === "none") {
      tints = new Uint8Array(3 * this.count).fill(OUTLIER[0]);
    }
    if (this.selected) {
      tints = tints!.slice();
      this.selected.forEach((is, i) => is && tints!.set(SELECTED, 3 * i));
    }
    geometry.setAttribute("tint", new BufferAttribute(tints!, 3, true));
  }

  /** True if points have colours of their own. */
  private get isTinted(): boolean {
    return this.colorBy !== "none" || this.selected !== null;
  }

  update(section: Section | null, look: Look): void {
    if (!this.modes.includes(this.colorBy)) this.colorBy = "none";
    this.tint();
    const { material } = this.object;
    const u = material.uniforms;
    this.object.visible = this.visible;
    u.plane.value = planeOf(section, this.origin);
    u.opacity.value = this.opacity;
    u.isTinted.value = this.isTinted;
    const size = this.count > 300_000 ? 2 : this.count > 30_000 ? 3 : this.count > 60 ? 4 : 8;
    u.size.value = size * look.pixelRatio;
    u.dot_size.value = look.pixelRatio;
    u.isRound.value = u.size.value > 2;
    u.color.value.set(...share(look.isDark ? [240, 190, 90] : [176, 84, 12]));
    material.transparent = this.opacity < 1;
  }

  /** Returns the foremost of the points near the pixel; of equal depths, the one nearest to the
   *  pixel. */
  pick(ray: Ray): Hit | null {
    const { array, from, step } = this.coordinates;
    const near: { i: number; p: V3; away: number; depth: number }[] = [];
    const p: V3 = [0, 0, 0];
    for (let i = 0; i < this.count; i++) {
      for (let k = 0; k < 3; k++) p[k] = from[k] + step[k] * array[3 * i + k];
      const [x, y, depth] = ray.project(p);
      const [a, b] = [x - ray.pixel[0], y - ray.pixel[1]];
      if (a * a + b * b > REACH * REACH || depth < ray.from) continue;
      if (ray.section && dot(ray.section.normal, p) > ray.section.offset) continue;
      near.push({ i, p: [...p], away: Math.hypot(a, b), depth });
    }
    if (!near.length) return null;
    const front = Math.min(...near.map((n) => n.depth));
    const size = norm(sub(this.coordinates.hi, this.coordinates.lo));
    const best = near
      .filter((n) => n.depth <= front + 0.02 * size)
      .reduce((a, b) => (b.away < a.away ? b : a));
    const away = dot(sub(best.p, ray.o), ray.d);
    const hit: Hit = {
      t: ray.from === 0 ? away * (1 - NEARER) : away - NEARER * size,
      point: best.p,
    };
    const deviation = this.deviation?.[best.i];
    if (deviation !== undefined && Number.isFinite(deviation)) hit.deviation = deviation;
    const entity = this.entities?.[best.i];
    if (entity) Object.assign(hit, { entity: entity - 1, part: `face ${entity - 1}` });
    return hit;
  }
}

/** Returns a scale with symmetric ends at a round number that most deviations do not exceed. */
export function scaleOf(values: Float32Array, limit?: number): Scale {
  const sizes = values.filter(Number.isFinite).map(Math.abs).sort();
  const end = limit ?? roundUp(sizes[Math.floor(WITHIN * (sizes.length - 1))] ?? 1);
  const squares = sizes.reduce((s, v) => s + v * v, 0);
  const histogram = Array<number>(STEPS).fill(0);
  for (const v of values) {
    const step = Math.floor((STEPS * (v + end)) / (2 * end));
    if (Number.isFinite(v)) histogram[Math.max(0, Math.min(STEPS - 1, step))] += 1;
  }
  return {
    histogram,
    title: "deviation, positive outside",
    lower: -end,
    upper: end,
    isDiverging: true,
    n: sizes.length,
    rms: Math.sqrt(squares / Math.max(1, sizes.length)),
    max: sizes[sizes.length - 1] ?? 0,
  };
}

// Points, drawn as discs of a few pixels.

import {
  BufferAttribute,
  BufferGeometry,
  DataTexture,
  GLSL3,
  Group,
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
/** Maximum number of points that are drawn in one frame; of more a sample moves with the view. */
const MOST_DRAWN = 500_000;
const GOLDEN = (Math.sqrt(5) - 1) / 2;
/** Number of values of which the ends of a scale are found. */
const SCALE_SAMPLE = 100_000;
/** Number of colours of a scale, and width of the texture of a palette. */
const SHADES = 1022;
const PALETTE_WIDTH = 256;
const OUTLIER: [number, number, number] = [96, 96, 102];
/** Colour of selected points. */
const SELECTED: [number, number, number] = [230, 0, 126];

/** Distance by which points are drawn nearer, as a fraction of their distance or of the whole. */
const NEARER = 0.002;

type Values = Float32Array | Uint16Array | Uint8Array;

/** Ways in which points are coloured: all alike, by a palette, by colours of their own. */
const [PLAIN, BY_PALETTE, OWN] = [0, 1, 2];

const VERTEX = `
#define NEARER ${NEARER}
uniform bool isFlat;
uniform float nearer;
uniform vec3 first;
uniform vec3 unit;
in float code;
in vec3 tint;
in float chosen;
uniform float size;
uniform float dot_size;
uniform vec4 plane;
uniform int coloring;
uniform sampler2D palette;
uniform vec3 color;
uniform vec3 selected;
flat out vec3 paint;
void main() {
  vec3 p = first + unit * position;
  vec4 shade = vec4(coloring == ${OWN} ? tint : color, 1.0);
  if (coloring == ${BY_PALETTE}) {
    int number = int(code);
    shade = texelFetch(palette, ivec2(number % ${PALETTE_WIDTH}, number / ${PALETTE_WIDTH}), 0);
  }
  bool isChosen = chosen > 0.0;
  paint = isChosen ? selected : shade.rgb;
  // Points out of focus, which are transparent, are small, so that they do not hide those in focus.
  gl_PointSize = shade.a < 0.5 && !isChosen ? min(size, dot_size) : size;
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
  readonly object = new Group();
  /** All points, and a sample of them if they are many. */
  private readonly whole: Points<BufferGeometry, ShaderMaterial>;
  private readonly sample: Points<BufferGeometry, ShaderMaterial> | null = null;
  /** Deviations from a model of the scene, which replace those of the file. */
  private measured: Float32Array | null = null;
  private limits: Scale | null = null;
  /** Colours that are drawn: of the points, and of the palette. */
  private tinted = "";
  private painted = "";
  focus: Set<number> | null = null;
  /** Value 1 for selected points; null if none is. */
  private selected: Uint8Array | null = null;
  /** Largest number in `entities`. */
  private readonly lastEntity: number;

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
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms: {
        size: { value: 3 },
        dot_size: { value: 1 },
        plane: { value: new Vector4(0, 0, 0, 1) },
        coloring: { value: PLAIN },
        palette: { value: new DataTexture(new Uint8Array(4 * PALETTE_WIDTH), PALETTE_WIDTH, 1) },
        isRound: { value: true },
        color: { value: new Vector3() },
        selected: { value: new Vector3(...share(SELECTED)) },
        opacity: { value: 1 },
        isFlat: { value: false },
        first: { value: new Vector3(...sub(coordinates.from, origin)) },
        unit: { value: new Vector3(...(coordinates.step as V3)) },
        nearer: { value: NEARER * norm(sub(coordinates.hi, coordinates.lo)) },
      },
    });
    const points = () => {
      const made = new Points(new BufferGeometry(), material);
      made.frustumCulled = false;
      made.onBeforeRender = (_r, _s, camera) => {
        material.uniforms.isFlat.value = "isOrthographicCamera" in camera;
        material.uniformsNeedUpdate = true;
      };
      this.object.add(made);
      return made;
    };
    this.whole = points();
    if (this.count > MOST_DRAWN) this.sample = points();
    this.set("position", coordinates.array, 3);
    this.lastEntity = this.entities?.reduce((a, b) => Math.max(a, b), 0) ?? 0;
    this.object.scale.set(...(coordinates.step as V3));
    this.object.position.set(...sub(coordinates.from, origin));
    if (this.colors) this.colorBy = "file";
    if (this.entities) this.colorBy = "part";
  }

  /** Sets an attribute of all points, and of the sample; null removes it. */
  private set(name: string, values: Values | null, size: number, isShare = false): void {
    this.whole.geometry.deleteAttribute(name);
    this.sample?.geometry.deleteAttribute(name);
    if (!values) return;
    this.whole.geometry.setAttribute(name, new BufferAttribute(values, size, isShare));
    if (!this.sample) return;
    const some = values.slice(0, size * MOST_DRAWN);
    for (let k = 0; k < MOST_DRAWN; k++) {
      // The golden section spreads each beginning of the sample over all points.
      const i = Math.floor(((k * GOLDEN) % 1) * this.count);
      for (let c = 0; c < size; c++) some[size * k + c] = values[size * i + c];
    }
    this.sample.geometry.setAttribute(name, new BufferAttribute(some, size, isShare));
  }

  /** Number of parts in which all points are drawn, one in a frame; 0 if one frame suffices. */
  get passes(): number {
    return this.sample ? Math.ceil(this.count / MOST_DRAWN) : 0;
  }

  /** Shows all points, a share of the sample (0), or one of the parts, counted from 1. */
  pass(part: number | null, share = 1): void {
    if (!this.sample) return;
    this.sample.geometry.setDrawRange(0, Math.ceil(share * MOST_DRAWN));
    this.sample.visible = part === 0;
    this.whole.visible = part !== 0;
    if (part) this.whole.geometry.setDrawRange((part - 1) * MOST_DRAWN, MOST_DRAWN);
    else this.whole.geometry.setDrawRange(0, Infinity);
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
    return Array.from({ length: this.lastEntity }, (_, i) => [`face ${i}`, css(partColor(i))]);
  }

  /** Selects points; null selects none. */
  select(selected: Uint8Array | null): void {
    this.selected = selected;
    this.set("chosen", selected, 1);
  }
  bounds(): Box | null {
    return this.count ? { lo: this.coordinates.lo as V3, hi: this.coordinates.hi as V3 } : null;
  }

  /** Returns a function that is true for the points within a radius of one. */
  within(center: ArrayLike<number>, radius: number): (i: number) => boolean {
    const { array, from, step } = this.coordinates;
    const squared = (i: number, k: number): number =>
      (from[k] + step[k] * array[3 * i + k] - center[k]) ** 2;
    return (i) => squared(i, 0) + squared(i, 1) + squared(i, 2) <= radius * radius;
  }

  /** Returns a function that is true for the points seen in a rectangle of pixels, given by its ends
   *  from the pixel of the ray. */
  seenIn({ forms, from }: Ray, x: number[], y: number[]): (i: number) => boolean {
    const { array } = this.coordinates;
    const [u, v, w, depth] = forms.map((form) => this.formOf(form));
    const value = (f: number[], i: number): number =>
      f[0] * array[3 * i] + f[1] * array[3 * i + 1] + f[2] * array[3 * i + 2] + f[3];
    return (i) => {
      const by = value(w, i);
      const [a, b] = [value(u, i), value(v, i)];
      const isIn = a >= x[0] * by && a <= x[1] * by && b >= y[0] * by && b <= y[1] * by;
      return isIn && value(depth, i) > from;
    };
  }

  /** Returns a linear form of coordinates as one of stored numbers. */
  private formOf(form: number[]): number[] {
    const { from, step } = this.coordinates;
    const constant = form[3] + form[0] * from[0] + form[1] * from[1] + form[2] * from[2];
    return [form[0] * step[0], form[1] * step[1], form[2] * step[2], constant];
  }

  /** Colours the points: the numbers of their colours change rarely, the palette with the focus. */
  private tint(): void {
    const scale = this.scale();
    const tinted = `${this.colorBy} ${scale?.upper}`;
    if (this.tinted !== tinted) {
      this.tinted = tinted;
      this.set("tint", this.colorBy === "file" ? this.colors : null, 3, true);
      this.set(
        "code",
        scale ? this.shades(scale) : this.colorBy === "part" ? this.entities : null,
        1,
      );
    }
    const painted = `${tinted} ${[...(this.focus ?? [])]}`;
    if (this.painted === painted) return;
    this.painted = painted;
    const colors = this.palette(scale);
    const rows = Math.ceil(colors.length / PALETTE_WIDTH) || 1;
    const data = new Uint8Array(4 * PALETTE_WIDTH * rows);
    colors.forEach((color, i) => data.set([...color, color === PALE ? 0 : 255], 4 * i));
    const { uniforms } = this.whole.material;
    uniforms.palette.value.dispose();
    uniforms.palette.value = new DataTexture(data, PALETTE_WIDTH, rows);
    uniforms.palette.value.needsUpdate = true;
  }

  /** Returns the colours that points have numbers of. */
  private palette(scale: Scale | null): [number, number, number][] {
    if (scale) {
      const { lower, upper } = scale;
      const at = (i: number): number => lower + ((upper - lower) * i) / (SHADES - 1);
      const shades = Array.from({ length: SHADES }, (_, i) =>
        scaleColor(at(i), lower, upper, true),
      );
      return [OUTLIER, scaleColor(NaN, lower, upper, true), ...shades];
    }
    if (this.colorBy !== "part") return [];
    const focused = (_: unknown, i: number) => focusedColor(i, this.focus);
    return [OUTLIER, ...Array.from({ length: this.lastEntity }, focused)];
  }

  /** Returns the number of the colour of each deviation. */
  private shades({ lower, upper }: Scale): Uint16Array<ArrayBuffer> {
    const { outliers } = this;
    const values = this.deviation!;
    const codes = new Uint16Array(values.length);
    const factor = (SHADES - 1) / (upper - lower);
    for (let i = 0; i < codes.length; i++) {
      const shade = Math.round((values[i] - lower) * factor);
      if (outliers?.[i]) codes[i] = 0;
      else if (!Number.isFinite(shade)) codes[i] = 1;
      else codes[i] = 2 + Math.max(0, Math.min(SHADES - 1, shade));
    }
    return codes;
  }

  update(section: Section | null, look: Look): void {
    if (!this.modes.includes(this.colorBy)) this.colorBy = "none";
    this.tint();
    const { material } = this.whole;
    const u = material.uniforms;
    this.object.visible = this.visible;
    u.plane.value = planeOf(section, this.origin);
    u.opacity.value = this.opacity;
    u.coloring.value = this.colorBy === "none" ? PLAIN : this.colorBy === "file" ? OWN : BY_PALETTE;
    const size = this.count > 300_000 ? 2 : this.count > 30_000 ? 3 : this.count > 60 ? 4 : 8;
    u.size.value = size * look.pixelRatio;
    u.dot_size.value = look.pixelRatio;
    u.isRound.value = u.size.value > 2;
    const plain: V3 = this.selected ? OUTLIER : look.isDark ? [240, 190, 90] : [176, 84, 12];
    u.color.value.set(...share(plain));
    material.transparent = this.opacity < 1;
  }

  /** Returns the foremost of the points near the pixel; of equal depths, the one nearest to the
   *  pixel. */
  pick(ray: Ray): Hit | null {
    const { array, from, step } = this.coordinates;
    const near: { i: number; p: V3; away: number; depth: number }[] = [];
    const [[u0, u1, u2, u3], , [w0, w1, w2, w3]] = ray.forms.map((form) => this.formOf(form));
    for (let i = 0; i < array.length; i += 3) {
      const a = array[i];
      const b = array[i + 1];
      const c = array[i + 2];
      // Most points are too far to the side.
      const reach = REACH * Math.abs(w0 * a + w1 * b + w2 * c + w3);
      if (!(Math.abs(u0 * a + u1 * b + u2 * c + u3) <= reach)) continue;
      const p: V3 = [from[0] + step[0] * a, from[1] + step[1] * b, from[2] + step[2] * c];
      const [x, y, depth] = ray.project(p);
      const away = Math.hypot(x - ray.pixel[0], y - ray.pixel[1]);
      if (away > REACH || depth < ray.from) continue;
      if (ray.section && dot(ray.section.normal, p) > ray.section.offset) continue;
      near.push({ i: i / 3, p, away, depth });
    }
    if (!near.length) return null;
    const front = near.reduce((least, n) => Math.min(least, n.depth), Infinity);
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
  const step = Math.ceil(values.length / SCALE_SAMPLE) || 1;
  const some = Float32Array.from(
    { length: Math.floor((values.length + step - 1) / step) },
    (_, i) => Math.abs(values[i * step]),
  );
  const sizes = some.filter(Number.isFinite).sort();
  const end = limit ?? roundUp(sizes[Math.floor(WITHIN * (sizes.length - 1))] ?? 1);
  const histogram = Array<number>(STEPS).fill(0);
  let [n, squares, max] = [0, 0, 0];
  for (const v of values) {
    if (!Number.isFinite(v)) continue;
    n += 1;
    squares += v * v;
    max = Math.max(max, Math.abs(v));
    const at = Math.floor((STEPS * (v + end)) / (2 * end));
    histogram[Math.max(0, Math.min(STEPS - 1, at))] += 1;
  }
  return {
    histogram,
    title: "deviation, positive outside",
    lower: -end,
    upper: end,
    isDiverging: true,
    n,
    rms: Math.sqrt(squares / Math.max(1, n)),
    max,
  };
}

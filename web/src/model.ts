// Model layer: a shader finds the surface at every pixel, for any values of the parameters.

import {
  BackSide,
  BoxGeometry,
  Data3DTexture,
  DataTexture,
  GLSL3,
  Matrix4,
  Mesh,
  NearestFilter,
  RedFormat,
  RGBAFormat,
  ShaderMaterial,
  Vector3,
  Vector4,
} from "three";
import { focusedColor, partColor, share } from "./colors";
import { NATIVE, SolidShader } from "./glsl";
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
import type { ModelDoc, ParameterDoc } from "./scene";
import { HATCH, LIGHT, planeOf } from "./shaders";
import { type Brick, gaps, Solid } from "./solid";
import { add, along, type Box, center, diagonal, dot, sub, through, type V3 } from "./vector";

const VERTEX = `
out vec3 place;
uniform vec3 cell;
uniform ivec3 cells;
void main() {
  place = position * cell * vec3(cells);
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}
`;

/** Fragment shader. All positions are relative to the centre of the brick, so that single precision
 *  suffices for models far from the origin. The ray passes from cell to cell of the brick, and at
 *  once through all the cells around it that hold no surface. In a cell that may contain surface
 *  the function is evaluated at a few points; where its sign changes between two of them, the root
 *  is bisected. */
const FRAGMENT = (solid: string, hasOpen: boolean) => `
${hasOpen ? "#define HAS_OPEN" : ""}
precision highp float;
precision highp int;
precision highp sampler3D;
in vec3 place;
out vec4 outColor;
uniform mat4 clip;
uniform vec3 ahead;
uniform bool isFlat;
uniform vec3 lo;
uniform vec3 cell;
uniform ivec3 cells;
uniform vec3 eye;
uniform sampler3D brick;
uniform sampler2D palette;
uniform bool isCut;
uniform bool byPart;
uniform vec4 plane;
uniform vec3 color;
uniform vec3 cap;
uniform vec3 back;
uniform bool hasCaps;
uniform float ball;
uniform float opacity;
uniform bool showsOpen;
uniform float least;
uniform float stripe;
${solid}
${LIGHT}
${HATCH}
const int STEPS = 4;
const int HALVINGS = 14;

#ifdef HAS_OPEN
// Stripes where the surface moves with parameters that are undetermined; slope is the gradient.
vec3 striped(vec3 base, vec3 p, float slope) {
  int part;
  float moves = abs(moved(p, part) - solid(p, part));
  if (!showsOpen || !(moves > least * slope)) return base;
  bool isStripe = mod(gl_FragCoord.x + gl_FragCoord.y, stripe) < 0.5 * stripe;
  return isStripe ? vec3(0.80, 0.16, 0.40) : mix(base, vec3(1.0), 0.35);
}
#endif

float at(vec3 p) { int part; return solid(p, part); }

// Returns the share of a way at which the function changes its sign.
float root(vec3 o, vec3 way, bool isInside) {
  float a = 0.0, width = 1.0;
  for (int k = 0; k < HALVINGS; k++) {
    width *= 0.5;
    if ((at(o + (a + width) * way) >= 0.0) == isInside) a += width;
  }
  return a + 0.5 * width;
}

void paint(vec3 p, vec3 toEye, bool isCap) {
  vec4 c = clip * vec4(p, 1.0);
  gl_FragDepth = 0.5 * c.z / c.w + 0.5;
  if (isCap) { outColor = vec4(hatched(cap), opacity); return; }
  vec3 base = color;
  if (byPart) {
    int part;
    solid(p, part);
    base = texelFetch(palette, ivec2(part & 1023, part >> 10), 0).rgb;
  }
  float h = 2e-3 * max(cell.x, max(cell.y, cell.z));
  vec2 k = vec2(1.0, -1.0);
  vec3 slope = k.xyy * at(p + h * k.xyy) + k.yyx * at(p + h * k.yyx);
  slope += k.yxy * at(p + h * k.yxy) + k.xxx * at(p + h * k.xxx);
  float size = length(slope);
  vec3 n = size > 0.0 ? -slope / size : toEye;
#ifdef HAS_OPEN
  base = striped(base, p, size / (4.0 * h));
#endif
  if (!hasCaps && !byPart && dot(n, toEye) < 0.0) base = back;
  outColor = vec4(lit(base, n, toEye), opacity);
}

void main() {
  vec3 d = isFlat ? ahead : normalize(place - eye);
  vec3 o = isFlat ? place - d * 4.0 * length(cell * vec3(cells)) : eye;
  vec3 inverse = 1.0 / mix(d, vec3(1e-12), lessThan(abs(d), vec3(1e-12)));
  vec3 p = (lo - o) * inverse, q = (lo + cell * vec3(cells) - o) * inverse;
  vec3 near = min(p, q), far = max(p, q);
  float from = max(max(near.x, near.y), max(near.z, 0.0)), to = min(far.x, min(far.y, far.z));
  if (ball > 0.0) {
    float b = dot(o, d), c = b * b - dot(o, o) + ball * ball;
    if (c <= 0.0) discard;
    from = max(from, -b - sqrt(c));
    to = min(to, -b + sqrt(c));
  }
  bool isAtBox = from > 0.0;
  float slope = dot(plane.xyz, d), room = plane.w - dot(plane.xyz, o);
  bool isAtPlane = false;
  if (slope > 0.0) to = min(to, room / slope);
  else if (slope < 0.0 && room / slope > from) { from = room / slope; isAtPlane = true; }
  else if (slope == 0.0 && room < 0.0) discard;
  if (from >= to) discard;
  float f = 0.0;
  bool isKnown = false;
  if (hasCaps && (isAtPlane || (isCut && isAtBox))) {
    f = at(o + from * d);
    isKnown = true;
    if (f >= 0.0) { paint(o + from * d, -d, true); return; }
  }
  vec3 start = (o + from * d - lo) / cell;
  ivec3 i = clamp(ivec3(floor(start)), ivec3(0), cells - 1);
  ivec3 way = ivec3(sign(inverse));
  vec3 next = (lo + cell * (vec3(i) + vec3(greaterThan(way, ivec3(0)))) - o) * inverse;
  vec3 width = abs(cell * inverse);
  float t = from;
  // Two places between which the sign changes. What follows is computed after the loop, for
  // neighbouring pixels at once.
  float before = 0.0, behind = 0.0;
  bool isFound = false, isInside = false;
  for (int k = 0; k < 400 && !isFound; k++) {
    // Cells to the nearest that may contain surface.
    float gap = round(255.0 * texelFetch(brick, i, 0).r);
    vec3 ends = next + max(gap - 1.0, 0.0) * width;
    float leave = min(min(ends.x, min(ends.y, ends.z)), to);
    if (gap == 0.0) {
      float a = t;
      for (int j = isKnown ? 1 : 0; j <= STEPS && !isFound; j++) {
        float b = mix(t, leave, float(j) / float(STEPS));
        float g = at(o + b * d);
        isFound = j > 0 && (f >= 0.0) != (g >= 0.0);
        before = a;
        behind = b;
        isInside = f >= 0.0;
        a = b;
        f = g;
      }
    }
    isKnown = gap == 0.0;
    if (leave >= to) break;
    t = leave;
    vec3 passed = max(floor((leave - next) / width) + 1.0, 0.0);
    i += way * ivec3(passed);
    next += passed * width;
    if (any(lessThan(i, ivec3(0))) || any(greaterThanEqual(i, cells))) break;
  }
  if (!isFound) discard;
  vec3 first = o + before * d, stride = (behind - before) * d;
  paint(first + root(first, stride, isInside) * stride, -d, false);
}
`;

/** Returns the colours of parts by their numbers, as a texture; parts with equal names have equal
 *  colours, and parts out of focus are pale. */
function paletteOf(parts: string[], focus: Set<number> | null): DataTexture {
  const names = [...new Set(parts)];
  const data = new Uint8Array(1024 * Math.max(1, Math.ceil(parts.length / 1024)) * 4);
  parts.forEach((name, i) => data.set([...focusedColor(names.indexOf(name), focus), 255], 4 * i));
  const texture = new DataTexture(data, 1024, data.length / 4096, RGBAFormat);
  texture.needsUpdate = true;
  return texture;
}

/** Change of undetermined parameters by which their effect is found: a fraction of their range, and
 *  a factor from one parameter to the next, so that no two changes are equal and cancel. */
const TRIAL = 0.002;
const UNLIKE = 1.17;
/** Relative displacement below which a point counts as fixed: the resolution of single precision.
 */
const MOVES = 2e-5;
/** Width of two stripes, in pixels of the page. */
const STRIPE = 10;
/** Colour of the back of surfaces, where the function is positive. */
const BACK: [number, number, number] = [226, 188, 128];

export class ModelLayer implements Layer {
  readonly kind = "model";
  readonly count = 1;
  readonly isSampled = true;
  visible = true;
  opacity = 1;
  colorBy: ColorMode = "none";
  focus: Set<number> | null = null;
  /** Parts in focus of the palette. */
  private focused = "";
  readonly modes: ColorMode[] = ["none", "part"];
  readonly extras: Extra[] = [];
  readonly solid: Solid;
  readonly object: Mesh<BoxGeometry, ShaderMaterial>;
  private brick: Brick | null = null;
  private readonly shader: SolidShader;
  /** Centre of the brick, in coordinates of the tape. */
  private middle: V3 = [0, 0, 0];

  constructor(
    readonly id: string,
    readonly doc: ModelDoc,
    private readonly origin: V3,
  ) {
    this.solid = new Solid(doc);
    this.shader = new SolidShader(this.solid.surface, doc.tree);
    if (this.open.length)
      this.extras.push({ key: "open", name: "Stripes: undetermined", isSlider: false, value: 1 });
    if (doc.isCut || doc.isSurface) {
      const value = doc.isSurface ? 0 : 1;
      this.extras.push({ key: "caps", name: "Caps", isSlider: false, value });
    }
    if (doc.isCut) this.extras.push({ key: "ball", name: "In a ball", isSlider: false, value: 0 });
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      side: BackSide,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT(this.functions(), this.open.length > 0),
      uniforms: {
        clip: { value: null },
        ahead: { value: new Vector3() },
        isFlat: { value: false },
        lo: { value: new Vector3() },
        cell: { value: new Vector3() },
        cells: { value: [1, 1, 1] },
        eye: { value: new Vector3() },
        brick: { value: null },
        palette: { value: paletteOf(doc.parts, null) },
        isCut: { value: doc.isCut },
        byPart: { value: false },
        plane: { value: new Vector4(0, 0, 0, 1) },
        color: { value: new Vector3(...share([132, 160, 190])) },
        cap: { value: new Vector3(...share([224, 164, 88])) },
        back: { value: new Vector3(...share(BACK)) },
        hasCaps: { value: true },
        ball: { value: 0 },
        opacity: { value: 1 },
        showsOpen: { value: true },
        least: { value: 0 },
        stripe: { value: STRIPE },
        u: { value: this.vectors() },
        w: { value: this.vectors() },
      },
    });
    this.object = new Mesh(new BoxGeometry(1, 1, 1), material);
    this.object.frustumCulled = false;
    this.object.onBeforeRender = (_r, _s, camera) => {
      const u = material.uniforms;
      // Computed in double precision: near the camera the difference is small.
      const { position } = this.object;
      const moved = new Matrix4().makeTranslation(position).premultiply(camera.matrixWorldInverse);
      u.clip.value = moved.premultiply(camera.projectionMatrix);
      u.eye.value.setFromMatrixPosition(camera.matrixWorld).sub(position);
      camera.getWorldDirection(u.ahead.value);
      u.isFlat.value = "isOrthographicCamera" in camera;
      material.uniformsNeedUpdate = true;
    };
    this.moved();
  }

  /** Returns the function of the solid, and a second one with undetermined parameters changed. */
  private functions(): string {
    const moved = this.open.length ? this.shader.text("moved", "w") : "";
    return NATIVE + this.shader.text("solid", "u") + moved;
  }
  private vectors(): Vector4[] {
    return Array.from({ length: this.shader.vectors }, () => new Vector4());
  }

  /** Returns the parameters that a fit left undetermined. */
  private get open(): ParameterDoc[] {
    return this.doc.parameters.filter((p) => p.isOpen);
  }
  get note(): string | undefined {
    const names = this.open.map((p) => p.name);
    return names.length
      ? `striped: what moves with ${names.join(", ")}, which the points leave undetermined`
      : undefined;
  }

  get name(): string {
    return this.doc.name;
  }
  get parameters(): ParameterDoc[] {
    return this.doc.parameters;
  }
  value(p: ParameterDoc): number {
    return this.solid.values[p.index] + p.shift;
  }

  /** Sets the values of parameters. */
  setValues(values: [ParameterDoc, number][]): void {
    for (const [p, value] of values) this.solid.values[p.index] = value - p.shift;
    this.solid.changed();
    this.moved();
  }

  /** Returns true if the parameters have their original values. */
  get isAsGiven(): boolean {
    return this.solid.isAsGiven;
  }

  /** Updates the grid and the uniforms for the current values. */
  private moved(): void {
    const u = this.object.material.uniforms;
    this.brick = this.solid.brick();
    u.brick.value?.dispose();
    u.brick.value = null;
    if (!this.brick) return;
    const { box, n } = this.brick;
    this.middle = center(box);
    this.fill(u.u.value);
    if (this.open.length) this.tryOpen(u.w.value);
    u.least.value = MOVES * diagonal(box);
    const texture = new Data3DTexture(gaps(this.brick), ...n);
    texture.format = RedFormat;
    texture.minFilter = texture.magFilter = NearestFilter;
    texture.unpackAlignment = 1;
    texture.needsUpdate = true;
    u.brick.value = texture;
    const size = sub(box.hi, box.lo);
    u.lo.value.set(...sub(box.lo, this.middle));
    u.cell.value.set(size[0] / n[0], size[1] / n[1], size[2] / n[2]);
    u.cells.value = n;
    this.object.scale.set(...size);
    this.object.position.set(...sub(this.inFile(this.middle), this.origin));
  }

  /** Copies the values of the shader's slots into its uniforms. */
  private fill(vectors: Vector4[]): void {
    const values = this.solid.at(this.middle, this.shader.slots);
    values.forEach((value, k) => vectors[k >> 2].setComponent(k & 3, value));
  }

  /** Fills the uniforms with undetermined parameters changed slightly, towards the farther end of
   *  their range. */
  private tryOpen(vectors: Vector4[]): void {
    const { values } = this.solid;
    const kept = [...values];
    this.open.forEach((p, k) => {
      const step = TRIAL * UNLIKE ** k * (p.upper - p.lower);
      const isLow = this.value(p) < 0.5 * (p.lower + p.upper);
      values[p.index] += isLow ? step : -step;
    });
    this.solid.changed();
    this.fill(vectors);
    kept.forEach((value, i) => (values[i] = value));
    this.solid.changed();
  }

  private inFile(p: V3): V3 {
    return add(p, this.doc.origin);
  }

  bounds(): Box | null {
    return (
      this.brick && {
        lo: this.inFile(this.brick.box.lo),
        hi: this.inFile(this.brick.box.hi),
      }
    );
  }

  legend(): [string, string][] {
    if (this.colorBy !== "part") return [];
    return [...new Set(this.doc.parts)].map((name, i) => [name, `rgb(${partColor(i)})`]);
  }
  scale(): Scale | null {
    return null;
  }

  update(section: Section | null, look: Look): void {
    const material = this.object.material;
    const u = material.uniforms;
    this.object.visible = this.visible && this.brick !== null;
    u.plane.value = planeOf(section, this.inFile(this.middle));
    u.opacity.value = this.opacity;
    u.byPart.value = this.colorBy === "part";
    const focus = `${[...(this.focus ?? [])]}`;
    if (focus !== this.focused) {
      this.focused = focus;
      u.palette.value.dispose();
      u.palette.value = paletteOf(this.doc.parts, this.focus);
    }
    u.hasCaps.value = this.hasCaps;
    u.ball.value = this.ball;
    u.showsOpen.value = chosen(this.extras, "open") === 1;
    u.stripe.value = STRIPE * look.pixelRatio;
    material.transparent = this.opacity < 1;
    material.depthWrite = true;
    this.object.renderOrder = this.opacity < 1 ? 1 : 0;
  }

  /** True if cuts are closed by caps. */
  private get hasCaps(): boolean {
    return this.extras.every((extra) => extra.key !== "caps" || extra.value === 1);
  }

  /** Radius of the ball in the brick that cuts the surface; 0 without. */
  private get ball(): number {
    if (!this.brick || chosen(this.extras, "ball") === 0) return 0;
    const { lo, hi } = this.brick.box;
    return 0.5 * Math.min(hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]);
  }

  pick(ray: Ray): Hit | null {
    if (!this.brick) return null;
    const o = sub(ray.o, this.doc.origin);
    const range = through(this.brick.box, o, ray.d);
    if (!range) return null;
    let [from, to] = [Math.max(range[0], ray.from), range[1]];
    let [isAtPlane, isAtBox] = [false, range[0] >= ray.from];
    if (ray.section) {
      const slope = dot(ray.section.normal, ray.d);
      const room = ray.section.offset - dot(ray.section.normal, ray.o);
      if (slope > 0) to = Math.min(to, room / slope);
      else if (slope < 0 && room / slope > from) [from, isAtPlane] = [room / slope, true];
      else if (slope === 0 && room < 0) return null;
    }
    if (this.ball > 0) {
      const toMiddle = sub(o, this.middle);
      const b = dot(toMiddle, ray.d);
      const c = b * b - dot(toMiddle, toMiddle) + this.ball * this.ball;
      if (c <= 0) return null;
      [from, to] = [Math.max(from, -b - Math.sqrt(c)), Math.min(to, -b + Math.sqrt(c))];
    }
    if (from >= to) return null;
    const isCap =
      this.hasCaps &&
      (isAtPlane || (this.doc.isCut && isAtBox)) &&
      this.solid.value(along(o, ray.d, from)) >= 0;
    const t = isCap ? from : this.solid.meet(o, ray.d, from, to);
    if (t === null) return null;
    const local = along(o, ray.d, t);
    const hit: Hit = { t, point: add(local, this.doc.origin) };
    if (isCap) hit.isCap = true;
    else hit.part = this.solid.partAt(local);
    return hit;
  }
}

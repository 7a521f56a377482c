// Translation of a tape to GLSL: a function of the point p that returns the value of the solid and
// the part that determines it.

import type { Step, Tape } from "./tape";

/** Kinds of slots as functions of the coordinates. */
const CONSTANT = 0;
const AFFINE = 1;
const OTHER = 2;

/** Maximum number of uniform components of the shader of one solid; every device has at least 224
 *  vectors of four. */
const MOST_UNIFORMS = 4 * 160;

function kind(op: string, args: number[]): number {
  const most = Math.max(...args);
  if (most !== AFFINE) return most;
  const isLinear =
    ["neg", "add", "sub"].includes(op) ||
    (op === "mul" && Math.min(...args) === CONSTANT) ||
    (op === "div" && args[1] === CONSTANT);
  return isLinear ? AFFINE : OTHER;
}

/** Determines which slots are constant and which are affine functions of the coordinates. */
function kinds(tape: Tape): Uint8Array {
  const all = new Uint8Array(tape.slots);
  all.fill(AFFINE, tape.firstX, tape.firstParameter);
  tape.steps.forEach((step, k) => {
    all[tape.firstStep + k] = kind(
      step.op,
      step.args.map((a) => all[a]),
    );
  });
  return all;
}

function literal(value: number): string {
  if (Number.isNaN(value)) return "0.0";
  const bounded = Math.max(-3e38, Math.min(3e38, value));
  // Some compilers reject literals below the smallest normal number.
  const text = Math.abs(bounded) < 1e-37 ? "0.0" : bounded.toExponential(8);
  return bounded < 0 ? `(${text})` : text;
}

type Write = (a: string, b: string, c: string, n: number) => string;

const WRITE: Record<string, Write> = {
  neg: (a) => `-${a}`,
  abs: (a) => `abs(${a})`,
  square: (a) => `${a} * ${a}`,
  sqrt: (a) => `sqrt(max(${a}, 0.0))`,
  exp: (a) => `exp(${a})`,
  ln: (a) => `log(max(${a}, 1e-37))`,
  sin: (a) => `sin(${a})`,
  cos: (a) => `cos(${a})`,
  tan: (a) => `tan(${a})`,
  asin: (a) => `asin(clamp(${a}, -1.0, 1.0))`,
  acos: (a) => `acos(clamp(${a}, -1.0, 1.0))`,
  atan: (a) => `atan(${a})`,
  sinh: (a) => `sinh(${a})`,
  cosh: (a) => `cosh(${a})`,
  tanh: (a) => `tanh(${a})`,
  floor: (a) => `floor(${a})`,
  ceil: (a) => `ceil(${a})`,
  trunc: (a) => `trunc(${a})`,
  sign: (a) => `sign(${a})`,
  add: (a, b) => `${a} + ${b}`,
  sub: (a, b) => `${a} - ${b}`,
  mul: (a, b) => `${a} * ${b}`,
  div: (a, b) => `${a} / ${b}`,
  pow: (a, b) => `pow(max(${a}, 0.0), ${b})`,
  atan2: (a, b) => `atan(${a}, ${b})`,
  less: (a, b) => `float(${a} < ${b})`,
  lesseq: (a, b) => `float(${a} <= ${b})`,
  runion: (a, b) => `${a} + ${b} + length(vec2(${a}, ${b}))`,
  rintersection: (a, b) => `${a} + ${b} - length(vec2(${a}, ${b}))`,
  max: (a, b) => `max(${a}, ${b})`,
  min: (a, b) => `min(${a}, ${b})`,
  select: (a, b, c) => `(${a} != 0.0 ? ${b} : ${c})`,
  powi: (a, _b, _c, n) => power(a, n),
};

function power(a: string, n: number): string {
  if (n === 0) return "1.0";
  const product =
    Math.abs(n) <= 16 ? Array(Math.abs(n)).fill(a).join(" * ") : `pow(abs(${a}), ${Math.abs(n)}.0)`;
  const signed = Math.abs(n) > 16 && n % 2 !== 0 ? `sign(${a}) * ${product}` : product;
  return n < 0 ? `1.0 / (${signed})` : signed;
}

/** Functions with inner iterations, shared by all solids of a shader. */
export const NATIVE = `
float ellipsoid(vec3 u, vec3 s) {
  u = abs(u); s = abs(s);
  vec3 s2 = s * s;
  float lo = -min(s2.x, min(s2.y, s2.z)), hi = length(u * s);
  for (int k = 0; k < 32; k++) {
    float m = 0.5 * (lo + hi);
    vec3 q = u * s / (m + s2);
    if (dot(q, q) > 1.0) lo = m; else hi = m;
  }
  return -hi * length(u / (hi + s2));
}
`;

/** Function in GLSL that returns the value of a solid at a point, for a tape whose results are its
 *  parts, joined by `tree`.
 *
 *  Points are given relative to a reference point near the solid, and numbers in single precision:
 *  far from the origin, x - c for a centre c would lose the significant digits. Therefore the
 *  shader computes only the linear part of affine functions of the coordinates; their values at the
 *  reference point are computed in double precision outside and added where other steps use the
 *  functions. */
export class SolidShader {
  /** Slots whose values at the reference point are the uniforms. */
  readonly slots: number[];
  private readonly kinds: Uint8Array;

  constructor(
    private readonly tape: Tape,
    private readonly tree: (number | "min" | "max")[],
  ) {
    this.kinds = kinds(tape);
    this.slots = this.uniforms();
    if (this.slots.length <= MOST_UNIFORMS) return;
    // With too many uniforms, only the coordinates are shifted.
    this.kinds.forEach((kind, slot) => {
      if (kind === AFFINE && slot >= tape.firstStep) this.kinds[slot] = OTHER;
    });
    this.slots = this.uniforms();
  }

  /** Returns the number of four-component vectors that hold the uniforms; at least one, as GLSL has
   *  no empty arrays. */
  get vectors(): number {
    return Math.max(1, Math.ceil(this.slots.length / 4));
  }

  /** Returns the slots that are used by value: constant and affine ones. */
  private uniforms(): number[] {
    const { tape } = this;
    const used = new Set<number>();
    const use = (slot: number) => {
      if (slot >= tape.firstX && this.kinds[slot] !== OTHER) used.add(slot);
    };
    tape.steps.forEach((step, k) => {
      const own = this.kinds[tape.firstStep + k];
      if (own === OTHER) step.args.forEach(use);
      // Factor of a linear part.
      else if (own === AFFINE && (step.op === "mul" || step.op === "div"))
        step.args.filter((a) => this.kinds[a] === CONSTANT).forEach(use);
    });
    tape.results.forEach(use);
    return [...used].sort((a, b) => a - b);
  }

  /** Returns the text of the function, with uniforms in an array. */
  text(name: string, uniforms: string): string {
    const value = this.values(uniforms);
    const lines: string[] = [];
    this.tape.steps.forEach((step, k) => {
      const slot = this.tape.firstStep + k;
      if (this.kinds[slot] === AFFINE) lines.push(`float l${slot} = ${this.linear(step, value)};`);
      else if (this.kinds[slot] === OTHER) lines.push(`float v${slot} = ${written(step, value)};`);
    });
    const root = this.joined(lines, value);
    return `uniform vec4 ${uniforms}[${this.vectors}];
float ${name}(vec3 p, out int part) {
${lines.join("\n")}
part = i${root};
return f${root};
}
`;
  }

  /** Returns the linear part of a slot; null if the slot is constant. */
  private part(slot: number): string | null {
    const { firstX, firstParameter } = this.tape;
    if (this.kinds[slot] === CONSTANT) return null;
    return slot < firstParameter ? `p.${"xyz"[slot - firstX]}` : `l${slot}`;
  }

  /** Returns the expressions by which the values of slots are read. */
  private values(uniforms: string): (slot: number) => string {
    const places = new Map(this.slots.map((slot, at) => [slot, at]));
    return (slot) => {
      if (slot < this.tape.firstX) return literal(this.tape.constants[slot]);
      if (this.kinds[slot] === OTHER) return `v${slot}`;
      const at = places.get(slot)!;
      const uniform = `${uniforms}[${at >> 2}].${"xyzw"[at & 3]}`;
      const part = this.part(slot);
      return part ? `(${part} + ${uniform})` : uniform;
    };
  }

  /** Returns the linear part of an affine step. */
  private linear(step: Step, value: (slot: number) => string): string {
    const [a, b] = step.args.map((slot) => this.part(slot));
    switch (step.op) {
      case "neg":
        return `-${a}`;
      case "mul":
        return a ? `${a} * ${value(step.args[1])}` : `${value(step.args[0])} * ${b}`;
      case "div":
        return `${a} / ${value(step.args[1])}`;
      case "add":
        return a && b ? `${a} + ${b}` : (a ?? b)!;
      default:
        return a && b ? `${a} - ${b}` : (a ?? `-${b}`);
    }
  }

  /** Appends lines that join the parts; returns the number of the root. */
  private joined(lines: string[], value: (slot: number) => string): number {
    const stack: number[] = [];
    this.tree.forEach((step, joins) => {
      if (typeof step === "number") {
        lines.push(`float f${joins} = ${value(this.tape.results[step])}; int i${joins} = ${step};`);
      } else {
        const [v, u] = [stack.pop(), stack.pop()];
        const isFirst = step === "min" ? `f${u} <= f${v}` : `f${u} >= f${v}`;
        lines.push(
          `bool b${joins} = ${isFirst};`,
          `float f${joins} = b${joins} ? f${u} : f${v};`,
          `int i${joins} = b${joins} ? i${u} : i${v};`,
        );
      }
      stack.push(joins);
    });
    return stack[stack.length - 1];
  }
}

/** Returns a step as an expression. */
function written(step: Step, value: (slot: number) => string): string {
  const args = step.args.map(value);
  if (step.op === "ellipsoid")
    return `ellipsoid(vec3(${args.slice(0, 3)}), vec3(${args.slice(3, 6)}))`;
  if (step.op === "fmod") return `(${args[0]} - ${args[1]} * trunc(${args[0]} / ${args[1]}))`;
  return WRITE[step.op](args[0], args[1], args[2], step.n);
}

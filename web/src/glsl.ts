// A tape as GLSL: a function of the point p that gives the solid's value and the part that decides.

import type { Tape } from "./tape";

/** Slots without coordinates that the varying steps use: their values are computed in double
 *  precision outside of the shader, and come as the uniforms `u`. */
export function freeSlots(tape: Tape): number[] {
  const isFree = (slot: number) =>
    slot >= tape.firstParameter && slot < tape.firstStep + tape.uniform;
  const used = new Set<number>();
  for (const step of tape.steps.slice(tape.uniform))
    for (const a of step.args) if (isFree(a)) used.add(a);
  for (const r of tape.results) if (isFree(r)) used.add(r);
  return [...used].sort((a, b) => a - b);
}

/** Vectors of four that the uniforms take; at least one, as GLSL has no empty arrays. */
export function uniformVectors(free: number[]): number {
  return Math.max(1, Math.ceil(free.length / 4));
}

function literal(value: number): string {
  if (Number.isNaN(value)) return "0.0";
  const bounded = Math.max(-3e38, Math.min(3e38, value));
  // Less than the least normal number is a literal that some compilers refuse.
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

const NATIVE = `
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

/** `float solid(vec3 p, out int part)` of a tape whose results are the parts, joined by `tree`. */
export function solidFunction(tape: Tape, tree: (number | "min" | "max")[]): string {
  const free = freeSlots(tape);
  const name = (slot: number): string => {
    if (slot < tape.firstX) return literal(tape.constants[slot]);
    if (slot < tape.firstParameter) return `p.${"xyz"[slot - tape.firstX]}`;
    const at = free.indexOf(slot);
    return at >= 0 ? `u[${at >> 2}].${"xyzw"[at & 3]}` : `v${slot}`;
  };
  const lines: string[] = [];
  tape.steps.forEach((step, k) => {
    if (k < tape.uniform) return;
    const args = step.args.map(name);
    const value =
      step.op === "ellipsoid"
        ? `ellipsoid(vec3(${args.slice(0, 3)}), vec3(${args.slice(3, 6)}))`
        : step.op === "fmod"
          ? `(${args[0]} - ${args[1]} * trunc(${args[0]} / ${args[1]}))`
          : WRITE[step.op](args[0], args[1], args[2], step.n);
    lines.push(`float v${tape.firstStep + k} = ${value};`);
  });
  const stack: number[] = [];
  let joins = 0;
  for (const step of tree) {
    if (typeof step === "number") {
      lines.push(`float f${joins} = ${name(tape.results[step])}; int i${joins} = ${step};`);
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
    joins += 1;
  }
  const root = stack[stack.length - 1];
  return `uniform vec4 u[${uniformVectors(free)}];
${NATIVE}
float solid(vec3 p, out int part) {
${lines.join("\n")}
part = i${root};
return f${root};
}
`;
}

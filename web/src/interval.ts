// Ranges of a tape's slots over a box, rounded to nearest: a range that is too narrow by a rounding
// error only omits surface that leaves a cell by that error, far below a pixel.

import type { Step, Tape } from "./tape";

export class Ranges {
  readonly lo: Float64Array;
  readonly hi: Float64Array;
  /** Function of each step, selected once because there are many boxes. */
  private readonly steps: Range[];
  constructor(readonly tape: Tape) {
    this.lo = new Float64Array(tape.slots);
    this.hi = new Float64Array(tape.slots);
    tape.constants.forEach((c, s) => {
      this.lo[s] = this.hi[s] = c;
    });
    this.steps = tape.steps.map((step, k) => rangeOf(step, tape.firstStep + k));
  }

  /** Sets the parameters and computes the slots that depend on them only. */
  set(values: ArrayLike<number>): void {
    for (let i = 0; i < this.tape.parameters; i++) {
      const slot = this.tape.firstParameter + i;
      this.lo[slot] = this.hi[slot] = values[i];
    }
    this.apply(0, this.tape.uniform);
  }

  /** Computes the ranges over a box. */
  run(lo: ArrayLike<number>, hi: ArrayLike<number>): void {
    for (let k = 0; k < 3; k++) {
      this.lo[this.tape.firstX + k] = lo[k];
      this.hi[this.tape.firstX + k] = hi[k];
    }
    this.apply(this.tape.uniform, this.tape.steps.length);
  }

  private apply(from: number, to: number): void {
    const { steps, lo, hi } = this;
    const first = this.tape.firstStep;
    for (let k = from; k < to; k++) {
      const slot = first + k;
      steps[k](lo, hi);
      // The range of an undefined value is unbounded.
      if (!(lo[slot] <= hi[slot])) {
        lo[slot] = -Infinity;
        hi[slot] = Infinity;
      }
    }
  }
}

type Row = Float64Array;

/** Increasing functions. */
const RISING: Record<string, (u: number) => number> = {
  sqrt: (u) => Math.sqrt(Math.max(u, 0)),
  exp: Math.exp,
  ln: (u) => Math.log(Math.max(u, 0)),
  asin: (u) => Math.asin(Math.max(-1, Math.min(1, u))),
  atan: Math.atan,
  sinh: Math.sinh,
  tanh: Math.tanh,
  floor: Math.floor,
  ceil: Math.ceil,
  trunc: Math.trunc,
  sign: Math.sign,
};

type Range = (lo: Row, hi: Row) => void;

/** Returns the function that computes the range of a step into slot `out`. */
function rangeOf({ op, args: [a, b, c], n }: Step, out: number): Range {
  const rising = RISING[op];
  if (rising) return (lo, hi) => set(lo, hi, out, rising(lo[a]), rising(hi[a]));
  switch (op) {
    case "neg":
      return (lo, hi) => set(lo, hi, out, -hi[a], -lo[a]);
    case "abs":
      return (lo, hi) => even(lo, hi, out, a, Math.abs);
    case "square":
      return (lo, hi) => even(lo, hi, out, a, (u) => u * u);
    case "cosh":
      return (lo, hi) => even(lo, hi, out, a, Math.cosh);
    case "powi":
      return (lo, hi) => integerPower(lo, hi, out, a, n);
    case "acos":
      return (lo, hi) =>
        set(lo, hi, out, Math.acos(Math.min(1, hi[a])), Math.acos(Math.max(-1, lo[a])));
    case "sin":
      return (lo, hi) => wave(lo, hi, out, lo[a] - Math.PI / 2, hi[a] - Math.PI / 2);
    case "cos":
      return (lo, hi) => wave(lo, hi, out, lo[a], hi[a]);
    case "tan":
      return (lo, hi) => tangent(lo, hi, out, a);
    case "add":
      return (lo, hi) => set(lo, hi, out, lo[a] + lo[b], hi[a] + hi[b]);
    case "sub":
      return (lo, hi) => set(lo, hi, out, lo[a] - hi[b], hi[a] - lo[b]);
    case "mul":
      return (lo, hi) => product(lo, hi, out, lo[a], hi[a], lo[b], hi[b]);
    case "div":
      return (lo, hi) => quotient(lo, hi, out, a, b);
    case "less":
      return (lo, hi) => set(lo, hi, out, hi[a] < lo[b] ? 1 : 0, lo[a] < hi[b] ? 1 : 0);
    case "lesseq":
      return (lo, hi) => set(lo, hi, out, hi[a] <= lo[b] ? 1 : 0, lo[a] <= hi[b] ? 1 : 0);
    case "max":
      return (lo, hi) => set(lo, hi, out, Math.max(lo[a], lo[b]), Math.max(hi[a], hi[b]));
    case "min":
      return (lo, hi) => set(lo, hi, out, Math.min(lo[a], lo[b]), Math.min(hi[a], hi[b]));
    case "runion":
      return joined(out, a, b, 1);
    case "rintersection":
      return joined(out, a, b, -1);
    case "select":
      return (lo, hi) => select(lo, hi, out, a, b, c);
    case "pow":
      return (lo, hi) => power(lo, hi, out, a, b);
    case "atan2":
      return (lo, hi) => set(lo, hi, out, -Math.PI, Math.PI);
    default:
      return (lo, hi) => set(lo, hi, out, -Infinity, Infinity);
  }
}

/** Computes the range of a tangent: it increases between two poles and is unbounded across one. */
function tangent(lo: Row, hi: Row, out: number, a: number): void {
  const branch = (u: number) => Math.floor(u / Math.PI + 0.5);
  const one = branch(lo[a]) === branch(hi[a]);
  set(lo, hi, out, one ? Math.tan(lo[a]) : -Infinity, one ? Math.tan(hi[a]) : Infinity);
}

function set(lo: Row, hi: Row, out: number, l: number, h: number): void {
  lo[out] = l;
  hi[out] = h;
}

/** Returns the range of an R-function, which increases in both arguments. */
function joined(out: number, a: number, b: number, sign: number): Range {
  const f = (u: number, v: number) => u + v + sign * Math.sqrt(u * u + v * v);
  return (lo, hi) => set(lo, hi, out, f(lo[a], lo[b]), f(hi[a], hi[b]));
}

function quotient(lo: Row, hi: Row, out: number, a: number, b: number): void {
  if (lo[b] > 0 || hi[b] < 0) product(lo, hi, out, lo[a], hi[a], 1 / hi[b], 1 / lo[b]);
  else set(lo, hi, out, -Infinity, Infinity);
}

function select(lo: Row, hi: Row, out: number, a: number, b: number, c: number): void {
  if (lo[a] > 0 || hi[a] < 0) set(lo, hi, out, lo[b], hi[b]);
  else if (lo[a] === 0 && hi[a] === 0) set(lo, hi, out, lo[c], hi[c]);
  else set(lo, hi, out, Math.min(lo[b], lo[c]), Math.max(hi[b], hi[c]));
}

/** Computes the range of a power with positive base and constant exponent. */
function power(lo: Row, hi: Row, out: number, a: number, b: number): void {
  if (!(lo[a] >= 0) || lo[b] !== hi[b]) return set(lo, hi, out, -Infinity, Infinity);
  const [p, q] = [lo[a] ** lo[b], hi[a] ** lo[b]];
  set(lo, hi, out, Math.min(p, q), Math.max(p, q));
}

/** Computes the range of an even function that increases from 0 on. */
function even(lo: Row, hi: Row, out: number, a: number, f: (u: number) => number): void {
  const [p, q] = [f(lo[a]), f(hi[a])];
  const least = lo[a] <= 0 && hi[a] >= 0 ? f(0) : Math.min(p, q);
  set(lo, hi, out, least, Math.max(p, q));
}

function integerPower(lo: Row, hi: Row, out: number, a: number, n: number): void {
  if (n < 0 && lo[a] <= 0 && hi[a] >= 0) set(lo, hi, out, -Infinity, Infinity);
  else if (n % 2 === 0 && n > 0) even(lo, hi, out, a, (u) => u ** n);
  else {
    const [p, q] = [lo[a] ** n, hi[a] ** n];
    set(lo, hi, out, Math.min(p, q), Math.max(p, q));
  }
}

/** Computes the range of the cosine. */
function wave(lo: Row, hi: Row, out: number, from: number, to: number): void {
  const turn = 2 * Math.PI;
  const holds = (at: number) => Math.ceil((from - at) / turn) * turn + at <= to;
  const [p, q] = [Math.cos(from), Math.cos(to)];
  set(lo, hi, out, holds(Math.PI) ? -1 : Math.min(p, q), holds(0) ? 1 : Math.max(p, q));
}

function product(lo: Row, hi: Row, out: number, a: number, b: number, c: number, d: number): void {
  const [p, q, r, s] = [a * c, a * d, b * c, b * d];
  set(lo, hi, out, Math.min(p, q, r, s), Math.max(p, q, r, s));
}

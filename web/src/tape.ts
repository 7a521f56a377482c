// Tape of a model: read from the document, reduced to the needs of some results, and evaluated in
// blocks of points in double precision, as by the Rust evaluators.

import { ellipsoidDistance, fmod, perlin, sardfRoot } from "./native";
import type { TapeDoc } from "./scene";

export interface Step {
  op: string;
  args: number[];
  n: number;
}

/** Sequence of steps on numbered slots: constants, coordinates, parameters, then one slot per step.
 */
export class Tape {
  constructor(
    readonly constants: number[],
    readonly inputs: number,
    readonly parameters: number,
    readonly steps: Step[],
    readonly uniform: number,
    readonly results: number[],
  ) {}

  static of(doc: TapeDoc): Tape {
    const steps = doc.steps.map(([op, ...args]) => {
      if (!(op in APPLY) && !(op in NATIVE))
        throw new Error(`the page does not know the operation ${op}`);
      return op === "powi" ? { op, args: [args[0]], n: args[1] } : { op, args, n: 0 };
    });
    return new Tape(
      doc.constants.map(Number),
      doc.inputs,
      doc.parameters,
      steps,
      doc.uniform,
      doc.results,
    );
  }

  get firstX(): number {
    return this.constants.length;
  }
  get firstParameter(): number {
    return this.firstX + this.inputs;
  }
  get firstStep(): number {
    return this.firstParameter + this.parameters;
  }
  get slots(): number {
    return this.firstStep + this.steps.length;
  }

  /** Returns the tape of some results, without the steps that they do not need. */
  only(results: number[]): Tape {
    const need = new Uint8Array(this.slots);
    for (const r of results) need[r] = 1;
    for (let k = this.steps.length - 1; k >= 0; k--) {
      if (need[this.firstStep + k]) for (const a of this.steps[k].args) need[a] = 1;
    }
    const place = new Int32Array(this.slots);
    for (let s = 0; s < this.firstStep; s++) place[s] = s;
    const steps: Step[] = [];
    let uniform = 0;
    this.steps.forEach((step, k) => {
      if (!need[this.firstStep + k]) return;
      place[this.firstStep + k] = this.firstStep + steps.length;
      steps.push({ ...step, args: step.args.map((a) => place[a]) });
      if (k < this.uniform) uniform += 1;
    });
    return new Tape(
      this.constants,
      this.inputs,
      this.parameters,
      steps,
      uniform,
      results.map((r) => place[r]),
    );
  }
}

type Row = Float64Array;
type Apply = (out: Row, n: number, power: number, a: Row, b: Row, c: Row) => void;

function unary(f: (u: number) => number): Apply {
  return (out, n, _, a) => {
    for (let i = 0; i < n; i++) out[i] = f(a[i]);
  };
}
function power(u: number, n: number): number {
  let result = 1;
  let base = n < 0 ? 1 / u : u;
  for (let k = Math.abs(n); k > 0; k >>= 1) {
    if (k & 1) result *= base;
    base *= base;
  }
  return result;
}

const APPLY: Record<string, Apply> = {
  neg: (o, n, _, a) => {
    for (let i = 0; i < n; i++) o[i] = -a[i];
  },
  abs: unary(Math.abs),
  square: (o, n, _, a) => {
    for (let i = 0; i < n; i++) o[i] = a[i] * a[i];
  },
  sqrt: unary(Math.sqrt),
  exp: unary(Math.exp),
  ln: unary(Math.log),
  sin: unary(Math.sin),
  cos: unary(Math.cos),
  tan: unary(Math.tan),
  asin: unary(Math.asin),
  acos: unary(Math.acos),
  atan: unary(Math.atan),
  sinh: unary(Math.sinh),
  cosh: unary(Math.cosh),
  tanh: unary(Math.tanh),
  floor: unary(Math.floor),
  ceil: unary(Math.ceil),
  trunc: unary(Math.trunc),
  sign: unary(Math.sign),
  add: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] + b[i];
  },
  sub: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] - b[i];
  },
  mul: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] * b[i];
  },
  div: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] / b[i];
  },
  pow: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] ** b[i];
  },
  atan2: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = Math.atan2(a[i], b[i]);
  },
  less: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] < b[i] ? 1 : 0;
  },
  lesseq: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] <= b[i] ? 1 : 0;
  },
  runion: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] + b[i] + Math.sqrt(a[i] * a[i] + b[i] * b[i]);
  },
  rintersection: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] + b[i] - Math.sqrt(a[i] * a[i] + b[i] * b[i]);
  },
  max: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] > b[i] ? a[i] : b[i];
  },
  min: (o, n, _, a, b) => {
    for (let i = 0; i < n; i++) o[i] = a[i] < b[i] ? a[i] : b[i];
  },
  powi: (o, n, p, a) => {
    for (let i = 0; i < n; i++) o[i] = power(a[i], p);
  },
  select: (o, n, _, a, b, c) => {
    for (let i = 0; i < n; i++) o[i] = a[i] !== 0 ? b[i] : c[i];
  },
};

const NATIVE: Record<string, (args: number[]) => number> = {
  ellipsoid: ellipsoidDistance,
  sardfroot: sardfRoot,
  fmod,
  perlin,
};

/** Number of points of a block. */
export const LANES = 128;

/** Evaluator of a tape on blocks of points; owns the memory of its slots. */
export class Evaluator {
  private readonly rows: Row[];
  constructor(readonly tape: Tape) {
    this.rows = Array.from({ length: tape.slots }, () => new Float64Array(LANES));
    tape.constants.forEach((c, s) => this.rows[s].fill(c));
  }

  /** Sets the parameters and computes the slots that depend on them only. */
  set(values: ArrayLike<number>): void {
    const { tape } = this;
    for (let i = 0; i < tape.parameters; i++) this.rows[tape.firstParameter + i].fill(values[i]);
    this.apply(0, tape.uniform, LANES);
  }

  /** Returns the row of a coordinate, to be filled before a run. */
  coordinate(k: number): Row {
    return this.rows[this.tape.firstX + k];
  }
  /** Returns the row of a slot after a run. */
  row(slot: number): Row {
    return this.rows[slot];
  }
  /** Returns the row of a result after a run. */
  result(k: number): Row {
    return this.rows[this.tape.results[k]];
  }

  /** Computes all slots for the first `n` points of the block. */
  run(n: number): void {
    this.apply(this.tape.uniform, this.tape.steps.length, n);
  }

  private apply(from: number, to: number, n: number): void {
    const { rows, tape } = this;
    const first = tape.firstStep;
    for (let k = from; k < to; k++) {
      const { op, args, n: exponent } = tape.steps[k];
      const out = rows[first + k];
      const f = APPLY[op];
      if (f) {
        f(out, n, exponent, rows[args[0]], rows[args[1]], rows[args[2]]);
      } else {
        const g = NATIVE[op];
        for (let i = 0; i < n; i++) out[i] = g(args.map((a) => rows[a][i]));
      }
    }
  }
}

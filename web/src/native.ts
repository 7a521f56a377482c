// Functions with inner iterations, equal to those of crates/isoform-field/src/native.rs.

function bisected(lo: number, hi: number, isBelow: (t: number) => boolean): number {
  for (let k = 0; k < 200; k++) {
    const m = 0.5 * (lo + hi);
    if (m <= lo || m >= hi) break;
    if (isBelow(m)) lo = m;
    else hi = m;
  }
  return 0.5 * (lo + hi);
}

/** Returns the signed distance to an ellipsoid around 0, positive inside, for a point and the half
 *  axes. */
export function ellipsoidDistance(args: number[]): number {
  const u = args.slice(0, 3).map(Math.abs);
  const s = args.slice(3, 6).map(Math.abs);
  if (s.includes(0)) return NaN;
  const sum = (f: (i: number) => number) => f(0) + f(1) + f(2);
  const g = (t: number) => sum((i) => ((u[i] * s[i]) / (t + s[i] * s[i])) ** 2) - 1;
  const least = Math.min(...s);
  const t = bisected(-least * least, Math.sqrt(sum((i) => (u[i] * s[i]) ** 2)), (t) => g(t) > 0);
  const isOff = (i: number) => t + s[i] * s[i] > 1e-9 * s[i] * s[i];
  if (isOff(0) && isOff(1) && isOff(2))
    return -t * Math.sqrt(sum((i) => (u[i] / (t + s[i] * s[i])) ** 2));
  const q = u.map((v, i) => (isOff(i) ? (v * s[i] * s[i]) / (t + s[i] * s[i]) : 0));
  const short = s.indexOf(least);
  const rest = sum((i) => (i === short ? 0 : (q[i] / s[i]) ** 2));
  q[short] = s[short] * Math.sqrt(Math.max(0, 1 - rest));
  const d = Math.sqrt(sum((i) => (u[i] - q[i]) ** 2));
  return sum((i) => (u[i] / s[i]) ** 2) <= 1 ? d : -d;
}

function realRoots(c: number[]): number[] {
  const degree = c.length - 1;
  if (degree === 1) return c[1] !== 0 ? [-c[0] / c[1]] : [];
  const derivative = c.slice(1).map((v, i) => v * (i + 1));
  const bound = 1 + Math.max(...c.slice(0, degree).map((v) => Math.abs(v / c[degree])));
  const cuts = [-bound, ...realRoots(derivative).filter((v) => Math.abs(v) < bound), bound];
  const at = (t: number) => c.reduceRight((s, k) => s * t + k, 0);
  const sign = (v: number) => (v < 0 || Object.is(v, -0) ? -1 : 1);
  const roots: number[] = [];
  for (let i = 0; i + 1 < cuts.length; i++) {
    const [a, b] = [at(cuts[i]), at(cuts[i + 1])];
    if (a === 0 && cuts[i] > -bound) roots.push(cuts[i]);
    else if (sign(a) !== sign(b))
      roots.push(bisected(cuts[i], cuts[i + 1], (t) => sign(at(t)) === sign(a)));
  }
  return roots;
}

/** Returns the second largest real root of the SARDF quartic. */
export function sardfRoot([f, g, r]: number[]): number {
  if (!(f > 0 && g > 0 && r > 0)) return 0;
  const q = Math.sqrt(r);
  const roots = realRoots([-(f * f + g * g), 4 * q * (f + g), -4 * r, -4 * q, 1]);
  return roots.length >= 2 ? roots[roots.length - 2] : 0;
}

/** Returns the remainder as fmod of C. */
export function fmod([u, v]: number[]): number {
  return u % v;
}

const MASK = (1n << 64n) - 1n;

/** Returns Perlin's noise with the bit mixing of the Rust code. */
export function perlin(args: number[]): number {
  const cell = args.map(Math.floor);
  const p = args.map((v, i) => v - cell[i]);
  const fade = p.map((t) => t ** 3 * (t * (t * 6 - 15) + 10));
  let sum = 0;
  for (let corner = 0; corner < 8; corner++) {
    const bit = [corner & 1, (corner >> 1) & 1, (corner >> 2) & 1];
    let hash = 0x9e3779b97f4a7c15n;
    for (let i = 0; i < 3; i++) {
      const at = BigInt.asUintN(64, BigInt(Math.max(-9e15, Math.min(9e15, cell[i] + bit[i]))));
      hash = ((hash ^ at) * 0xbf58476d1ce4e5b9n) & MASK;
      hash ^= hash >> 29n;
    }
    const n = Number((hash >> 33n) % 12n);
    const [a, b] = [
      [0, 1],
      [0, 2],
      [1, 2],
    ][Math.floor(n / 4)];
    let term = (n & 1 ? -1 : 1) * (p[a] - bit[a]) + (n & 2 ? -1 : 1) * (p[b] - bit[b]);
    for (let i = 0; i < 3; i++) term *= bit[i] ? fade[i] : 1 - fade[i];
    sum += term;
  }
  return sum;
}

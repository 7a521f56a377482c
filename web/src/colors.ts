// Colours of parts, of deviations and of sequential values; all palettes suit colour-blind readers.

/** Okabe and Ito's palette without black, with lighter colours where the originals are too dark on
 *  a dark page. */
const PARTS: [number, number, number][] = [
  [86, 180, 233],
  [230, 159, 0],
  [0, 158, 115],
  [204, 121, 167],
  [240, 228, 66],
  [0, 114, 178],
  [213, 94, 0],
  [148, 148, 158],
];

/** Returns the colour of part number i: eight hues, then darker ones, then lighter ones. */
export function partColor(i: number): [number, number, number] {
  const color = PARTS[i % PARTS.length];
  const turn = Math.floor(i / PARTS.length) % 3;
  const mix = (v: number) =>
    Math.round(turn === 0 ? v : turn === 1 ? 0.62 * v : 255 - 0.55 * (255 - v));
  return [mix(color[0]), mix(color[1]), mix(color[2])];
}

/** Returns the colour of part number i, pale if other parts are in focus. */
export function focusedColor(i: number, focus: Set<number> | null): [number, number, number] {
  return !focus || focus.has(i) ? partColor(i) : PALE;
}
/** Colour of parts out of focus, which no part has. */
export const PALE: [number, number, number] = [178, 184, 191];

type Stops = [number, number, number][];
/** Colours from blue through the light grey of the neutral band to red (after ColorBrewer's RdBu).
 */
const DIVERGING: Stops = [
  [20, 80, 160],
  [67, 147, 195],
  [146, 197, 222],
  [198, 198, 192],
  [244, 165, 130],
  [214, 96, 77],
  [165, 15, 30],
];
/** Viridis at seven evenly spaced values. */
const SEQUENTIAL: Stops = [
  [68, 1, 84],
  [70, 50, 126],
  [54, 92, 141],
  [39, 127, 142],
  [31, 161, 135],
  [74, 193, 109],
  [253, 231, 37],
];

/** Fraction of a diverging scale on either side of zero that is neutral. */
export const NEUTRAL = 0.1;

function mixed(stops: Stops, at: number): [number, number, number] {
  const place = Math.max(0, Math.min(1, at)) * (stops.length - 1);
  const k = Math.min(stops.length - 2, Math.floor(place));
  const f = place - k;
  const channel = (c: number) => Math.round(stops[k][c] + f * (stops[k + 1][c] - stops[k][c]));
  return [channel(0), channel(1), channel(2)];
}

/** Returns the colour of a value between the ends of its scale; grey if it is not finite. */
export function scaleColor(
  value: number,
  lower: number,
  upper: number,
  isDiverging: boolean,
): [number, number, number] {
  if (!Number.isFinite(value)) return [110, 110, 110];
  const share = upper > lower ? (value - lower) / (upper - lower) : 0.5;
  if (!isDiverging) return mixed(SEQUENTIAL, share);
  const signed = 2 * share - 1;
  if (Math.abs(signed) <= NEUTRAL) return DIVERGING[3];
  const rest = (Math.abs(signed) - NEUTRAL) / (1 - NEUTRAL);
  return mixed(DIVERGING, 0.5 + 0.5 * Math.sign(signed) * (0.12 + 0.88 * rest));
}

export const css = (c: ArrayLike<number>): string => `rgb(${c[0]} ${c[1]} ${c[2]})`;
export const share = (c: ArrayLike<number>): [number, number, number] => [
  c[0] / 255,
  c[1] / 255,
  c[2] / 255,
];

/** Returns the smallest 1, 2 or 5 times a power of ten that is not below v. */
export function roundUp(v: number): number {
  if (!(v > 0 && Number.isFinite(v))) return 1;
  const power = 10 ** Math.floor(Math.log10(v));
  return [1, 2, 5, 10].map((m) => m * power).find((c) => c >= v * (1 - 1e-12)) ?? v;
}

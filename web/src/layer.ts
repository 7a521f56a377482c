// Interface of all layers: state, colours and operations.

import type { Object3D } from "three";
import type { Box, V3 } from "./vector";

/** Section plane in coordinates of the file; what lies beyond it is hidden. */
export interface Section {
  normal: V3;
  offset: number;
}

/** Line of sight of a pixel, in coordinates of the file. */
export interface Ray {
  o: V3;
  d: V3;
  /** Smallest visible distance. */
  from: number;
  section: Section | null;
  /** Returns the pixel and the depth of a point; depth is measured along the central line of sight.
   */
  project(p: ArrayLike<number>): [number, number, number];
  /** Pixel of the line of sight. */
  pixel: [number, number];
  /** Linear forms of coordinates, with their constants: w times the way from the pixel to a point's
   *  to the right and down, in pixels; w; and the depth. */
  forms: number[][];
}

/** Visible point at a pixel. */
export interface Hit {
  /** Distance along the ray. */
  t: number;
  point: V3;
  part?: string;
  /** Number of the entity of a point. */
  entity?: number;
  deviation?: number;
  parameter?: [number, number];
  isCap?: boolean;
}

export const COLOR_MODES = [
  "none",
  "part",
  "deviation",
  "quality",
  "u",
  "v",
  "bound",
  "file",
] as const;
export type ColorMode = (typeof COLOR_MODES)[number];

/** Meaning of a layer's colours, for its scale bar. */
export interface Scale {
  title: string;
  lower: number;
  upper: number;
  isDiverging: boolean;
  n: number;
  rms: number;
  /** Largest value; smallest value with isLeast. */
  max: number;
  isLeast?: boolean;
  left?: number;
  /** Numbers of values in equal steps from lower to upper; values beyond the ends are in the first
   *  and the last one. */
  histogram?: number[];
}

/** Additional option of a layer: a switch (0 or 1), or a slider from 0 to 1. */
export interface Extra {
  /** Key of the option in the address of a page. */
  key: "edges" | "inside" | "quality" | "open" | "nets" | "lines" | "caps" | "ball";
  name: string;
  isSlider: boolean;
  value: number;
}

/** Returns the value of an option; 0 if the layer does not have it. */
export function chosen(extras: Extra[], key: Extra["key"]): number {
  return extras.find((extra) => extra.key === key)?.value ?? 0;
}

export interface Layer {
  /** Additional options; undefined if there are none. `update` draws their effect. */
  readonly extras?: Extra[];
  readonly id: string;
  readonly name: string;
  readonly kind: string;
  readonly count: number;
  visible: boolean;
  opacity: number;
  colorBy: ColorMode;
  /** Parts that keep their colours while the others are pale; null for all. */
  focus?: Set<number> | null;
  /** Available colourings. */
  readonly modes: ColorMode[];
  /** True if edges have one sample per pixel. */
  readonly isSampled?: boolean;
  /** Number of parts in which the whole is drawn, one in a frame; 0 or undefined if one suffices. */
  readonly passes?: number;
  /** Shows the whole, a share of what moves with the view (0), or one of the parts. */
  pass?(part: number | null, share?: number): void;
  /** Explanation of the signs; undefined if there is none. */
  readonly note?: string;
  /** Displayed object, in coordinates of the scene. */
  readonly object: Object3D;
  /** Returns the names and colours of the parts while the layer is coloured by part. */
  legend(): [string, string][];
  scale(): Scale | null;
  bounds(): Box | null;
  /** Updates the displayed object for visible, opacity, colorBy and the section plane. */
  update(section: Section | null, look: Look): void;
  pick(ray: Ray): Hit | null;
}

/** Settings of theme and camera that affect drawing. */
export interface Look {
  isDark: boolean;
  pixelRatio: number;
}

// What all layers share: their state, their colours, and what is asked of them.

import type { Object3D } from "three";
import type { Box, V3 } from "./vector";

/** A plane that cuts away what is beyond it, in coordinates of the file. */
export interface Section {
  normal: V3;
  offset: number;
}

/** A pixel's line of sight, in coordinates of the file. */
export interface Ray {
  o: V3;
  d: V3;
  /** The least distance that is seen. */
  from: number;
  section: Section | null;
  /** The pixel of the pane and the depth of a point; depth is that along d of the pane's middle. */
  project(p: ArrayLike<number>): [number, number, number];
  /** The pixel itself. */
  pixel: [number, number];
}

/** What is seen at a pixel. */
export interface Hit {
  /** Along the ray. */
  t: number;
  point: V3;
  part?: string;
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

/** What the colours of a layer mean, for the bar beside them. */
export interface Scale {
  title: string;
  lower: number;
  upper: number;
  isDiverging: boolean;
  n: number;
  rms: number;
  /** The largest value, or (isLeast) the least. */
  max: number;
  isLeast?: boolean;
  left?: number;
}

/** A further choice of a layer: a switch (0 or 1), or a slider from 0 to 1. */
export interface Extra {
  /** Its key in the address of a page. */
  key: "edges" | "inside" | "quality" | "open" | "nets" | "lines";
  name: string;
  isSlider: boolean;
  value: number;
}

/** The value of a further choice; 0 where a layer does not have it. */
export function chosen(extras: Extra[], key: Extra["key"]): number {
  return extras.find((extra) => extra.key === key)?.value ?? 0;
}

export interface Layer {
  /** Further choices; may be missing. What they change is drawn by update. */
  readonly extras?: Extra[];
  readonly id: string;
  readonly name: string;
  readonly kind: string;
  readonly count: number;
  visible: boolean;
  opacity: number;
  colorBy: ColorMode;
  /** Colours that it has. */
  readonly modes: ColorMode[];
  /** Whether its edges have one sample a pixel. */
  readonly isSampled?: boolean;
  /** What its signs mean; may be missing. */
  readonly note?: string;
  /** What is drawn, in coordinates of the scene. */
  readonly object: Object3D;
  /** The names of its parts with their colours, while it is coloured so. */
  legend(): [string, string][];
  scale(): Scale | null;
  bounds(): Box | null;
  /** Brings what is drawn up to date with visible, opacity, colorBy and the plane. */
  update(section: Section | null, look: Look): void;
  pick(ray: Ray): Hit | null;
}

/** What the theme and the camera say of drawing. */
export interface Look {
  isDark: boolean;
  pixelRatio: number;
}

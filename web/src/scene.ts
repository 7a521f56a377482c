// Document of the scene as written by the Rust crate.

export type Vec3 = [number, number, number];

export interface BlobRef {
  blob: number;
  type: "f64" | "f32" | "u32" | "u16" | "u8";
  n: number;
  deflated: boolean;
  /** Bytes of a packed scene; undefined if an element of the page holds them. */
  bytes?: Uint8Array<ArrayBuffer>;
}
/** Coordinates: from + step * array. */
export interface Positions {
  array: BlobRef;
  from: Vec3;
  step: Vec3;
  lo: Vec3;
  hi: Vec3;
}
export interface Numbers {
  array: BlobRef;
  from: number;
  step: number;
}

export interface TapeDoc {
  inputs: number;
  parameters: number;
  constants: (number | string)[];
  steps: [string, ...number[]][];
  uniform: number;
  results: number[];
}

export interface ParameterDoc {
  index: number;
  name: string;
  description: string;
  unit: string | null;
  value: number;
  lower: number;
  upper: number;
  shift: number;
  /** True if a fit left it undetermined. */
  isOpen: boolean;
}

export interface ModelDoc {
  kind: "model";
  name: string;
  title: string | null;
  tape: TapeDoc;
  tree: (number | "min" | "max")[];
  parts: string[];
  values: number[];
  parameters: ParameterDoc[];
  bounds: [Vec3, Vec3];
  isCut: boolean;
  /** True if the surface is meant, not the solid: it has two sides, and no caps. */
  isSurface: boolean;
  /** True if the box is that of points in the scene, which the surface may leave. */
  isLoose: boolean;
  origin: Vec3;
}

export interface PointsDoc {
  kind: "points";
  name: string;
  count: number;
  positions: Positions;
  deviation?: Numbers;
  limit?: number;
  outliers?: BlobRef;
  colors?: BlobRef;
  /** Entity of each point plus 1; 0 for points of none. */
  entities?: BlobRef;
}

/** Surface of a face: a frame, and its measures in the order of exact.ts. */
export interface SurfaceDoc {
  kind: "plane" | "cylinder" | "cone" | "sphere" | "torus" | "ellipsoid";
  origin: Vec3;
  z: Vec3;
  x: Vec3;
  measures: number[];
}

export interface MeshDoc {
  kind: "mesh" | "solid" | "model";
  name: string;
  count: number;
  positions: Positions;
  triangles: BlobRef;
  parts: string[];
  triangleParts?: BlobRef;
  tets?: BlobRef;
  edges?: BlobRef;
  /** Only for solids: the face of each triangle, and the surface of each face; null for splines. */
  triangleFaces?: BlobRef;
  surfaces?: (SurfaceDoc | null)[];
  columns: { name: string; values: Numbers }[];
}

export interface PatchesDoc {
  kind: "patches";
  name: string;
  control: BlobRef;
  patches: { name: string; degree: [number, number]; distance: number | null }[];
  bounds: [Vec3, Vec3];
}

export interface MapDoc {
  kind: "map";
  name: string;
  count: number;
  positions: Positions;
  triangles: BlobRef;
  charts: BlobRef;
  corners: BlobRef;
  frame: number[][] | null;
  degree: number;
  forms: [number, number, number][][];
  halfWidth: number;
  basePoints: Vec3[];
  double: Vec3[][];
  solitary: Vec3[][];
  isCertified: boolean;
}

export type LayerDoc = ModelDoc | PointsDoc | MeshDoc | PatchesDoc | MapDoc;
export interface SceneDoc {
  version: number;
  title: string;
  layers: LayerDoc[];
}

/** Returns the scene of a document with its arrays in bytes: the length of the document as a
 *  little-endian 32-bit integer, the document, the arrays, whose lengths it lists. */
export function unpackScene(packed: ArrayBuffer): SceneDoc {
  const length = new DataView(packed).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(packed, 4, length));
  const lengths: number[] = JSON.parse(text).arrays;
  const starts = lengths.reduce((all, n) => [...all, all[all.length - 1] + n], [4 + length]);
  return JSON.parse(text, (_, value) => {
    if (typeof value?.blob === "number" && "deflated" in value) {
      const bytes = packed.slice(starts[value.blob], starts[value.blob + 1]);
      value.bytes = new Uint8Array(bytes);
    }
    return value;
  });
}

export function readScene(): SceneDoc {
  const element = document.querySelector("[data-isoform-scene]");
  return JSON.parse(element?.textContent ?? '{"version":1,"title":"","layers":[]}');
}

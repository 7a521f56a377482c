// Binary PLY files as Isoform writes them: points as rows of fixed length.

import { dot, type V3 } from "../vector";

interface Property {
  name: string;
  type: string;
  offset: number;
}
const SIZES: Record<string, number> = {
  char: 1,
  uchar: 1,
  int8: 1,
  uint8: 1,
  short: 2,
  ushort: 2,
  int16: 2,
  uint16: 2,
  int: 4,
  uint: 4,
  int32: 4,
  uint32: 4,
  float: 4,
  float32: 4,
  double: 8,
  float64: 8,
};
/** Maximum number of bytes of a header. */
const MOST_HEADER = 1 << 16;

export class Ply {
  readonly count: number;
  private readonly header: string;
  private readonly start: number;
  private readonly row: number;
  private readonly properties: Property[] = [];
  private readonly view: DataView;

  constructor(private readonly bytes: ArrayBuffer) {
    const text = new TextDecoder("latin1").decode(bytes.slice(0, MOST_HEADER));
    const end = text.indexOf("end_header\n");
    if (!text.startsWith("ply") || end < 0) throw new Error("not a PLY file");
    this.start = end + "end_header\n".length;
    this.header = text.slice(0, this.start);
    const words = this.header.split("\n").map((line) => line.trim().split(/\s+/));
    if (!words.some(([a, b]) => a === "format" && b === "binary_little_endian"))
      throw new Error("not a binary PLY file");
    const elements = words.filter(([a]) => a === "element");
    if (elements[0]?.[1] !== "vertex") throw new Error("the PLY file does not begin with points");
    this.count = Number(elements[0][2]);
    let offset = 0;
    let isVertex = false;
    for (const [word, type, name] of words) {
      if (word === "element") isVertex = type === "vertex";
      if (word !== "property" || !isVertex) continue;
      if (!(type in SIZES)) throw new Error(`points have a property of type ${type}`);
      this.properties.push({ name, type, offset });
      offset += SIZES[type];
    }
    this.row = offset;
    this.view = new DataView(bytes);
    if (this.start + this.count * this.row > bytes.byteLength)
      throw new Error("the PLY file is cut off");
  }

  /** Returns the file with other values of a property of doubles, and without what follows the
   *  points. */
  withColumn(name: string, value: (i: number) => number): ArrayBuffer {
    const property = this.properties.find((p) => p.name === name);
    if (property?.type !== "double") throw new Error(`points have no ${name}`);
    const out = this.bytes.slice(0, this.start + this.count * this.row);
    const view = new DataView(out);
    for (let i = 0; i < this.count; i++)
      view.setFloat64(this.start + i * this.row + property.offset, value(i), true);
    return out;
  }

  /** Returns the values of a property of doubles. */
  column(name: string): Float64Array {
    const property = this.properties.find((p) => p.name === name);
    if (property?.type !== "double") throw new Error(`points have no ${name}`);
    return Float64Array.from({ length: this.count }, (_, i) =>
      this.view.getFloat64(this.start + i * this.row + property.offset, true),
    );
  }

  /** Returns the file of the points in another frame, without faces: its origin, and its axes as unit
   *  vectors. Normals are turned with the points. */
  inFrame(origin: V3, axes: [V3, V3, V3]): ArrayBuffer {
    const out = this.filtered(() => true);
    const start = out.byteLength - this.count * this.row;
    const view = new DataView(out);
    for (const [names, from] of [
      [["x", "y", "z"], origin],
      [
        ["nx", "ny", "nz"],
        [0, 0, 0],
      ],
    ] as const) {
      const own = names.map((name) => this.properties.find((p) => p.name === name));
      if (own.some((p) => p === undefined)) continue;
      const isDouble = own[0]!.type === "double" || own[0]!.type === "float64";
      const read = isDouble ? view.getFloat64 : view.getFloat32;
      const write = isDouble ? view.setFloat64 : view.setFloat32;
      for (let i = 0; i < this.count; i++) {
        const at = own.map((p) => start + i * this.row + p!.offset);
        const p = at.map((a, k) => read.call(view, a, true) - from[k]);
        axes.forEach((axis, k) => write.call(view, at[k], dot(axis, p), true));
      }
    }
    return out;
  }

  /** Returns the file of some of the points, without faces. */
  filtered(isKept: (i: number) => boolean): ArrayBuffer {
    const kept = Array.from({ length: this.count }, (_, i) => i).filter(isKept);
    const lines = this.header.split("\n");
    const other = lines.findIndex((line, i) => i > 0 && /^element (?!vertex)/.test(line));
    const own = other < 0 ? lines : [...lines.slice(0, other), "end_header", ""];
    const header = own
      .map((line) => (line.startsWith("element vertex") ? `element vertex ${kept.length}` : line))
      .join("\n");
    const head = new TextEncoder().encode(header);
    const out = new Uint8Array(head.length + kept.length * this.row);
    out.set(head);
    const rows = new Uint8Array(this.bytes, this.start);
    kept.forEach((i, k) =>
      out.set(rows.subarray(i * this.row, (i + 1) * this.row), head.length + k * this.row),
    );
    return out.buffer;
  }
}

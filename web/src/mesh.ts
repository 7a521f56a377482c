// Meshes: triangles with parts, tetrahedra with their quality, caps of sections.

import { BufferAttribute, BufferGeometry, Group, Mesh, type ShaderMaterial } from "three";
import { Bvh, type Meeting } from "./bvh";
import * as bytes from "./bytes";
import { type Cap, ofSurface, ofTetrahedra } from "./caps";
import { focusedColor, partColor, scaleColor } from "./colors";
import {
  chosen,
  type ColorMode,
  type Extra,
  type Hit,
  type Layer,
  type Look,
  type Ray,
  type Scale,
  type Section,
} from "./layer";
import { meetSurface } from "./exact";
import { scaleOf } from "./points";
import type { MeshDoc } from "./scene";
import { Surface, surfaceMaterial } from "./triangles";
import { type Box, along, cross, diagonal, dot, norm, sub, type V3 } from "./vector";

const PLAIN: [number, number, number] = [158, 170, 164];
const CAP: [number, number, number] = [224, 164, 88];

/** Returns the quality of a triangle: 1 if it is equilateral, 0 if it has no area. */
function quality(a: ArrayLike<number>, b: ArrayLike<number>, c: ArrayLike<number>): number {
  const [u, v, w] = [sub(b, a), sub(c, b), sub(a, c)];
  return (2 * Math.sqrt(3) * norm(cross(u, v))) / (dot(u, u) + dot(v, v) + dot(w, w) || 1);
}

/** Returns the quality of a tetrahedron, 1 if it is regular and 0 if it has no volume: its volume
 *  in proportion to the cube of the root mean square of its edges. */
function tetQuality([a, b, c, d]: ArrayLike<number>[]): number {
  const edges = [sub(b, a), sub(c, a), sub(d, a), sub(c, b), sub(d, b), sub(d, c)];
  const mean = edges.reduce((s, e) => s + dot(e, e), 0) / 6;
  const volume = dot(edges[0], cross(edges[1], edges[2])) / 6;
  return Math.max(0, (6 * Math.SQRT2 * volume) / (mean ** 1.5 || 1));
}

/** Factor by which tetrahedra are shrunk, and indices of the corners of their faces. */
const SHRUNK = 0.85;
const FACES = [1, 2, 3, 0, 3, 2, 0, 1, 3, 0, 2, 1];

/** Maximum distance along a line of sight between a triangle and its face, as a fraction of the
 *  size: triangles are within a thousandth of it, but may be seen at a small angle. */
const NEAR_FACE = 0.02;

export class MeshLayer implements Layer {
  visible = true;
  opacity = 1;
  colorBy: ColorMode = "none";
  readonly modes: ColorMode[] = ["none", "quality"];
  readonly extras: Extra[] = [
    { key: "edges", name: "Edges of elements", isSlider: false, value: 1 },
  ];
  readonly object = new Group();
  private readonly surface: Surface;
  private inside: { surface: Surface; threshold: number } | null = null;
  private readonly columns = new Map<ColorMode, Float32Array>();
  private readonly cap: Mesh<BufferGeometry, ShaderMaterial>;
  private capTree: Bvh | null = null;
  private cutBy = "";
  private painted = "";
  focus: Set<number> | null = null;
  private limits: Scale | null = null;

  private constructor(
    readonly id: string,
    private readonly doc: MeshDoc,
    points: Float64Array,
    triangles: Uint32Array,
    private readonly parts: Uint32Array | null,
    private readonly faces: Uint32Array | null,
    readonly tets: Uint32Array | null,
    private readonly origin: V3,
  ) {
    this.surface = new Surface(points, triangles, origin);
    this.cap = new Mesh(new BufferGeometry(), surfaceMaterial());
    this.cap.material.uniforms.isCap.value = true;
    this.cap.frustumCulled = false;
    this.object.add(this.surface.object, this.cap);
    if (parts) this.modes.splice(1, 0, "part");
    if (doc.kind === "solid") {
      // The faces are exact; their triangles are only for drawing.
      this.colorBy = parts ? "part" : "none";
      for (const extra of this.extras) extra.value = 0;
    }
    if (tets)
      this.extras.push(
        { key: "inside", name: "Tetrahedra, shrunk", isSlider: false, value: 0 },
        { key: "quality", name: "of quality at most", isSlider: true, value: 1 },
      );
  }

  static async of(id: string, doc: MeshDoc, origin: V3): Promise<MeshLayer> {
    const points = bytes.doubles(await bytes.coordinates(doc.positions));
    const triangles = await bytes.u32(doc.triangles);
    const parts = doc.triangleParts ? await bytes.u32(doc.triangleParts) : null;
    const faces = doc.triangleFaces ? await bytes.u32(doc.triangleFaces) : null;
    const tets = doc.tets ? await bytes.u32(doc.tets) : null;
    const layer = new MeshLayer(id, doc, points, triangles, parts, faces, tets, origin);
    for (const column of doc.columns) {
      const mode = column.name === "distance" ? "deviation" : column.name;
      const values = await bytes.numbers(column.values);
      if (mode === "deviation" || mode === "u" || mode === "v") {
        layer.columns.set(mode, values);
        layer.modes.push(mode);
      }
    }
    if (doc.edges) layer.surface.curves(layer.edges(await bytes.u32(doc.edges)), [40, 44, 52]);
    return layer;
  }

  get name(): string {
    return this.doc.name;
  }
  get kind(): string {
    return this.doc.kind;
  }
  get count(): number {
    return this.doc.count;
  }
  bounds(): Box {
    return { lo: this.doc.positions.lo, hi: this.doc.positions.hi };
  }

  private edges(nodes: Uint32Array): Float32Array {
    const pairs = new Float32Array(3 * nodes.length);
    nodes.forEach((node, i) => {
      for (let k = 0; k < 3; k++)
        pairs[3 * i + k] = this.surface.points[3 * node + k] - this.origin[k];
    });
    return pairs;
  }

  private qualities(): Float32Array {
    const { points, triangles, count } = this.surface;
    const at = (i: number) => points.subarray(3 * triangles[i], 3 * triangles[i] + 3);
    return Float32Array.from({ length: count }, (_, i) =>
      quality(at(3 * i), at(3 * i + 1), at(3 * i + 2)),
    );
  }

  private paint(): void {
    const painted = `${this.colorBy} ${[...(this.focus ?? [])]}`;
    if (this.painted === painted) return;
    this.painted = painted;
    this.limits = null;
    const { surface, parts } = this;
    const values = this.columns.get(this.colorBy);
    if (this.colorBy === "part" && parts) {
      surface.paint((corner) => focusedColor(parts[Math.floor(corner / 3)], this.focus));
    } else if (this.colorBy === "quality") {
      const all = this.qualities();
      this.limits = {
        title: "quality of triangles",
        lower: 0,
        upper: 1,
        isDiverging: false,
        n: all.length,
        rms: NaN,
        max: all.reduce((least, v) => Math.min(least, v), 1),
        isLeast: true,
      };
      surface.paint((corner) => scaleColor(all[Math.floor(corner / 3)], 0, 1, false));
    } else if (values) {
      const scale =
        this.colorBy === "deviation"
          ? scaleOf(values)
          : {
              title: this.colorBy,
              lower: 0,
              upper: 1,
              isDiverging: false,
              n: values.length,
              rms: NaN,
              max: NaN,
            };
      this.limits = scale;
      surface.paint((corner) =>
        scaleColor(values[surface.triangles[corner]], scale.lower, scale.upper, scale.isDiverging),
      );
    } else {
      surface.paint(() => PLAIN);
    }
  }

  legend(): [string, string][] {
    if (this.colorBy !== "part") return [];
    return this.doc.parts.map((name, i) => [name, `rgb(${partColor(i)})`]);
  }
  scale(): Scale | null {
    return this.limits;
  }

  /** Updates the cap of the current plane. */
  private cut(section: Section | null): void {
    const by = JSON.stringify(section);
    if (by === this.cutBy) return;
    this.cutBy = by;
    this.capTree = null;
    const { points, triangles } = this.surface;
    const cap: Cap = !section
      ? []
      : this.tets
        ? ofTetrahedra(points, this.tets, section)
        : ofSurface(points, triangles, section);
    const corners = new Float32Array(cap.length);
    const tints = new Uint8Array(cap.length);
    for (let i = 0; i < cap.length; i++) {
      corners[i] = cap[i] - this.origin[i % 3];
      tints[i] = CAP[i % 3];
    }
    this.cap.geometry.dispose();
    this.cap.geometry = new BufferGeometry();
    this.cap.geometry.setAttribute("position", new BufferAttribute(corners, 3));
    this.cap.geometry.setAttribute("tint", new BufferAttribute(tints, 3, true));
    if (cap.length)
      this.capTree = new Bvh(
        Float64Array.from(cap),
        Uint32Array.from({ length: cap.length / 3 }, (_, i) => i),
      );
  }

  update(section: Section | null, look: Look): void {
    if (!this.modes.includes(this.colorBy)) this.colorBy = "none";
    this.paint();
    this.cut(section);
    const hasEdges = chosen(this.extras, "edges") === 1;
    const isInside = chosen(this.extras, "inside") === 1;
    if (isInside) this.open(chosen(this.extras, "quality"));
    this.surface.update(this.visible && !isInside, this.opacity, hasEdges, section, look);
    this.inside?.surface.update(this.visible && isInside, this.opacity, hasEdges, section, look);
    this.cap.visible = this.visible && this.capTree !== null && !isInside;
    const u = this.cap.material.uniforms;
    u.opacity.value = this.opacity;
    u.hasEdges.value = this.tets !== null;
    this.cap.material.transparent = this.opacity < 1;
  }

  /** Shows the tetrahedra up to a quality, each shrunk towards its centre and coloured by its
   *  quality. */
  private open(threshold: number): void {
    if (this.inside?.threshold === threshold) return;
    if (this.inside) {
      this.object.remove(this.inside.surface.object);
      this.inside.surface.dispose();
    }
    const { points } = this.surface;
    const corners: number[] = [];
    const qualities: number[] = [];
    for (let t = 0; t < this.tets!.length; t += 4) {
      const nodes = [0, 1, 2, 3].map((k) =>
        points.subarray(3 * this.tets![t + k], 3 * this.tets![t + k] + 3),
      );
      const q = tetQuality(nodes);
      if (q > threshold) continue;
      qualities.push(q);
      for (const p of nodes)
        for (let k = 0; k < 3; k++)
          corners.push(SHRUNK * p[k] + (1 - SHRUNK) * 0.25 * nodes.reduce((s, n) => s + n[k], 0));
    }
    const faces = Uint32Array.from(qualities.flatMap((_, i) => FACES.map((k) => 4 * i + k)));
    const surface = new Surface(Float64Array.from(corners), faces, this.origin);
    surface.paint((corner) => scaleColor(qualities[Math.floor(corner / 12)], 0, 1, false));
    this.object.add(surface.object);
    this.inside = { surface, threshold };
  }

  /** Returns the distance at which a ray meets the exact face of a triangle; for splines, the
   *  triangle itself. */
  private exactly(ray: Ray, found: Meeting): number {
    const surface = this.faces && this.doc.surfaces?.[this.faces[found.triangle]];
    if (!surface) return found.t;
    const reach = NEAR_FACE * diagonal(this.bounds());
    return meetSurface(surface, ray.o, ray.d, found.t, reach) ?? found.t;
  }

  pick(ray: Ray): Hit | null {
    if (chosen(this.extras, "inside") === 1 && this.inside) {
      const met = this.inside.surface.meet(ray);
      return met && { t: met.t, point: along(ray.o, ray.d, met.t) };
    }
    const found = this.surface.meet(ray);
    const cut = ray.section && this.capTree?.meet(ray.o, ray.d, ray.from, () => true);
    if (cut && (!found || cut.t < found.t))
      return { t: cut.t, point: along(ray.o, ray.d, cut.t), isCap: true };
    if (!found) return null;
    const t = this.exactly(ray, found);
    const hit: Hit = { t, point: along(ray.o, ray.d, t) };
    const part = this.parts && this.doc.parts[this.parts[found.triangle]];
    if (part) hit.part = part;
    const at = (values: Float32Array) => {
      const [a, b, c] = [0, 1, 2].map(
        (k) => values[this.surface.triangles[3 * found.triangle + k]],
      );
      return (1 - found.u - found.v) * a + found.u * b + found.v * c;
    };
    const [u, v, deviation] = (["u", "v", "deviation"] as const).map((name) =>
      this.columns.get(name),
    );
    if (u && v) hit.parameter = [at(u), at(v)];
    if (deviation) hit.deviation = at(deviation);
    return hit;
  }
}

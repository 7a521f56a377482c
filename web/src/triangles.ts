// Triangle surfaces, the common part of meshes, patches and maps.

import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLSL3,
  Group,
  Mesh,
  ShaderMaterial,
  Vector3,
  Vector4,
} from "three";
import { Bvh, type Meeting } from "./bvh";
import type { Look, Ray, Section } from "./layer";
import { type Lines, segments, showLines } from "./lines";
import { HATCH, LIGHT, planeOf } from "./shaders";
import { dot, type V3 } from "./vector";

/** Number of triangles above which their edges are not drawn, as they would hide everything else.
 */
const MOST_EDGES = 60_000;

const VERTEX = `
in vec3 tint;
in vec3 slope;
in float rank;
uniform bool hasSlopes;
uniform bool isFlat;
uniform float nearer;
out vec3 place;
out vec3 paint;
out vec3 corner;
out vec3 side;
void main() {
  place = position;
  paint = tint;
  side = hasSlopes ? slope : vec3(0.0);
  int c = gl_VertexID % 3;
  corner = vec3(c == 0, c == 1, c == 2);
  // Surfaces of higher rank come nearer to the eye, along the line of sight.
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  if (isFlat) seen.z += rank * nearer;
  else seen.xyz *= 1.0 - rank * nearer / max(length(seen.xyz), 1e-30);
  gl_Position = projectionMatrix * seen;
}
`;
const FRAGMENT = `
precision highp float;
in vec3 place;
in vec3 paint;
in vec3 corner;
in vec3 side;
uniform bool hasSlopes;
uniform bool hasEdges;
uniform bool isCap;
uniform bool isFlat;
uniform vec3 ahead;
uniform vec3 eye;
uniform vec4 plane;
uniform float opacity;
out vec4 outColor;
${LIGHT}
${HATCH}
void main() {
  if (!isCap && dot(plane.xyz, place) > plane.w) discard;
  vec3 toEye = isFlat ? -ahead : normalize(eye - place);
  vec3 face = cross(dFdx(place), dFdy(place));
  vec3 n = hasSlopes && dot(side, side) > 0.0 ? normalize(side) : normalize(face);
  vec3 color = isCap ? hatched(paint) : lit(paint, n, toEye);
  if (hasEdges) {
    vec3 w = corner / max(fwidth(corner), vec3(1e-9));
    float line = clamp(1.0 - min(w.x, min(w.y, w.z)), 0.0, 1.0);
    color = mix(color, 0.45 * color, 0.55 * line);
  }
  outColor = vec4(color, opacity);
}
`;

export function surfaceMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    side: DoubleSide,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: {
      plane: { value: new Vector4(0, 0, 0, 1) },
      opacity: { value: 1 },
      hasEdges: { value: false },
      hasSlopes: { value: false },
      isCap: { value: false },
      isFlat: { value: false },
      ahead: { value: new Vector3() },
      eye: { value: new Vector3() },
      nearer: { value: 0 },
    },
  });
}

/** Passes the position of the eye, in the coordinates of the corners, to the shader of triangles.
 */
function lookAt(mesh: Mesh<BufferGeometry, ShaderMaterial>): void {
  mesh.onBeforeRender = (_r, _s, camera) => {
    const u = mesh.material.uniforms;
    camera.getWorldDirection(u.ahead.value);
    u.eye.value
      .setFromMatrixPosition(camera.matrixWorld)
      .sub(new Vector3().setFromMatrixPosition(mesh.matrixWorld));
    u.isFlat.value = "isOrthographicCamera" in camera;
    mesh.material.uniformsNeedUpdate = true;
  };
}

/** Triangles in coordinates of the file, drawn relative to an origin near them. */
export class Surface {
  readonly object = new Group();
  private readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;
  private tree: Bvh | null = null;
  private lines: Lines | null = null;

  constructor(
    readonly points: Float64Array,
    readonly triangles: Uint32Array,
    private readonly origin: V3,
    slopes?: Float32Array,
  ) {
    const positions = new Float32Array(3 * triangles.length);
    for (let i = 0; i < triangles.length; i++) {
      for (let k = 0; k < 3; k++) positions[3 * i + k] = points[3 * triangles[i] + k] - origin[k];
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(positions, 3));
    if (slopes) geometry.setAttribute("slope", new BufferAttribute(slopes, 3));
    this.mesh = new Mesh(geometry, surfaceMaterial());
    const u = this.mesh.material.uniforms;
    u.hasSlopes.value = slopes !== undefined;
    this.mesh.frustumCulled = false;
    lookAt(this.mesh);
    this.object.add(this.mesh);
  }

  get count(): number {
    return this.triangles.length / 3;
  }
  get canHaveEdges(): boolean {
    return this.count <= MOST_EDGES;
  }

  /** Sets the ranks of coincident surfaces: higher ranks are drawn in front, by the distance
   *  `nearer` per rank. */
  rank(of: (corner: number) => number, nearer: number): void {
    const ranks = Float32Array.from({ length: this.triangles.length }, (_, i) => of(i));
    this.mesh.geometry.setAttribute("rank", new BufferAttribute(ranks, 1));
    this.mesh.material.uniforms.nearer.value = nearer;
  }

  /** Sets one colour for each corner of each triangle. */
  paint(color: (corner: number) => ArrayLike<number>): void {
    const tints = new Uint8Array(3 * this.triangles.length);
    for (let i = 0; i < this.triangles.length; i++) tints.set(color(i) as number[], 3 * i);
    this.mesh.geometry.setAttribute("tint", new BufferAttribute(tints, 3, true));
  }

  /** Draws curves on the surface, as pairs of points of the file. */
  curves(pairs: Float32Array, color: [number, number, number]): void {
    this.lines = segments(pairs, color);
    this.object.add(this.lines);
  }

  update(
    visible: boolean,
    opacity: number,
    hasEdges: boolean,
    section: Section | null,
    _look: Look,
    hasCurves = true,
  ): void {
    const { material } = this.mesh;
    const u = material.uniforms;
    this.object.visible = visible;
    u.plane.value = planeOf(section, this.origin);
    u.opacity.value = opacity;
    u.hasEdges.value = hasEdges && this.canHaveEdges;
    material.transparent = opacity < 1;
    this.mesh.renderOrder = opacity < 1 ? 1 : 0;
    if (this.lines) showLines(this.lines, hasCurves, u.plane.value);
  }

  /** Frees the memory of the displayed objects. */
  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }

  meet(ray: Ray): Meeting | null {
    this.tree ??= new Bvh(this.points, this.triangles);
    const { section } = ray;
    return this.tree.meet(
      ray.o,
      ray.d,
      ray.from,
      (p) => !section || dot(section.normal, p) <= section.offset,
    );
  }
}

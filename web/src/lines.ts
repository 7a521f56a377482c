// Curves in space: pairs of points, relative to the origin of their layer.

import {
  BufferAttribute,
  BufferGeometry,
  GLSL3,
  LineSegments,
  ShaderMaterial,
  Vector3,
  Vector4,
} from "three";
import { share } from "./colors";

const VERTEX = `
uniform vec4 plane;
uniform bool isFlat;
uniform float nearer;
in float along;
out vec3 place;
out float length_;
void main() {
  place = position;
  length_ = along;
  // Curves on a surface are to be seen before it.
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  if (isFlat) seen.z += nearer; else seen.xyz *= 0.999;
  gl_Position = projectionMatrix * seen;
}
`;
const FRAGMENT = `
precision highp float;
in vec3 place;
in float length_;
uniform vec4 plane;
uniform vec3 color;
uniform float dash;
out vec4 outColor;
void main() {
  if (dot(plane.xyz, place) > plane.w) discard;
  if (dash > 0.0 && mod(length_, 2.0 * dash) > dash) discard;
  outColor = vec4(color, 1.0);
}
`;

export type Lines = LineSegments<BufferGeometry, ShaderMaterial>;

/** Creates segments between pairs of points, dashed with the given length if that is not 0. */
export function segments(pairs: Float32Array, color: [number, number, number], dash = 0): Lines {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(pairs, 3));
  geometry.computeBoundingSphere();
  const material = new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: {
      plane: { value: new Vector4(0, 0, 0, 1) },
      color: { value: new Vector3(...share(color)) },
      dash: { value: dash },
      isFlat: { value: false },
      nearer: { value: 1e-3 * (geometry.boundingSphere?.radius || 0) },
    },
  });
  const lines = new LineSegments(geometry, material);
  if (dash) {
    lines.computeLineDistances();
    geometry.setAttribute("along", geometry.getAttribute("lineDistance"));
  }
  lines.frustumCulled = false;
  lines.onBeforeRender = (_r, _s, camera) => {
    material.uniforms.isFlat.value = "isOrthographicCamera" in camera;
    material.uniformsNeedUpdate = true;
  };
  return lines;
}

/** Shows segments up to a plane given in coordinates of the layer. */
export function showLines(lines: Lines, isVisible: boolean, plane: Vector4): void {
  lines.visible = isVisible;
  lines.material.uniforms.plane.value = plane;
}

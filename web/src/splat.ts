// SPDX-License-Identifier: Apache-2.0
// A splat as it was made to be seen: each Gaussian an ellipse on the screen, from the farthest to
// the nearest.

import * as THREE from "three";
import { dot, length, sub } from "./camera_math";
import type { Frame, Vec3 } from "./protocol";
import { SeenSurface } from "./surface";

const NUMBERS = 12; // of each Gaussian: mean, colour, covariance, opacity, 0; see docs/protocol.md
const OPACITY = 10; // which of these
const PER_ROW = 1024; // of the texture
const TEXELS = NUMBERS / 4; // of each
const DEPTHS = 65_536; // steps by which they are sorted
const MOST_IN_SOFTWARE = 6_000; // that a processor draws
const MOST_MET = 60_000; // among which a pointer looks
const SOLID = 0.5; // opacity of what a pointer meets
const TURNED = Math.cos(0.02); // [rad] of the view, after which they are sorted again
const MOVED = 0.02; // [-] of the eye's distance, likewise
const REST = 4; // times as long as sorting takes is between two

const vertexShader = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D gaussians;
uniform mat4 viewMatrix, projectionMatrix;
uniform vec2 viewport;
uniform float wider;
#ifdef SOLID
const float REACH = 1.18;  // deviations, where an opacity of one has become a half
#else
const float REACH = 2.83;
#endif
in vec3 position;
in uint which;
out vec2 place;
out vec4 colour;
const float LARGEST = 1024.0;  // [px]
vec4 texel(uint k) {
  return texelFetch(gaussians, ivec2(3u * (which % ${PER_ROW}u) + k, which / ${PER_ROW}u), 0);
}
void main() {
  vec4 a = texel(0u), b = texel(1u), c = texel(2u);
  mat3 covariance = wider * mat3(b.x, b.y, b.z, b.y, b.w, c.x, b.z, c.x, c.y);
  vec3 mean = (viewMatrix * vec4(a.xyz, 1.0)).xyz;
  vec4 centre = projectionMatrix * vec4(mean, 1.0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
#ifdef SOLID
  if (c.z < 0.5) return;
#endif
  bool aside = any(greaterThan(abs(centre.xy), vec2(1.5 * centre.w)));
  if (centre.w <= 0.0 || centre.z < -centre.w || aside) return;
  // How its place in the picture changes with its place before the eye [px / m].
  vec2 focal = 0.5 * viewport * vec2(projectionMatrix[0][0], projectionMatrix[1][1]) / -mean.z;
  mat3 turn = mat3(viewMatrix);
  vec3 u = vec3(focal.x, 0.0, -focal.x * mean.x / mean.z) * turn;
  vec3 v = vec3(0.0, focal.y, -focal.y * mean.y / mean.z) * turn;
  float uu = dot(u, covariance * u) + 0.3;
  float uv = dot(u, covariance * v);
  float vv = dot(v, covariance * v) + 0.3;
  float half_of = 0.5 * (uu + vv);
  float apart = length(vec2(0.5 * (uu - vv), uv));
  vec2 along = apart < 1e-6 ? vec2(1.0, 0.0)
               : uu > vv    ? normalize(vec2(half_of + apart - vv, uv))
                            : normalize(vec2(uv, half_of + apart - uu));
  vec2 sides = min(REACH * sqrt(vec2(half_of + apart, max(half_of - apart, 0.1))), LARGEST);
  vec2 off = position.x * sides.x * along + position.y * sides.y * vec2(-along.y, along.x);
  gl_Position = centre + vec4(2.0 * off / viewport * centre.w, 0.0, 0.0);
  place = REACH * position.xy;
  uint rgb = uint(a.w);
  colour = vec4(vec3(uvec3(rgb >> 16u, rgb >> 8u, rgb) & 255u) / 255.0, c.z);
}
`;

const fragmentShader = /* glsl */ `
precision mediump float;
in vec2 place;
in vec4 colour;
out vec4 fragment;
void main() {
#ifdef SOLID
  if (dot(place, place) > 1.39) discard;
  fragment = vec4(colour.rgb, 1.0);
  return;
#endif
  float alpha = colour.a * exp(-0.5 * dot(place, place));
  if (alpha < 0.004) discard;
  fragment = vec4(colour.rgb, alpha);
}
`;

function textureOf(gaussians: Float32Array): THREE.DataTexture {
  const rows = Math.ceil(gaussians.length / (NUMBERS * PER_ROW));
  const texels = new Float32Array(NUMBERS * PER_ROW * rows);
  texels.set(gaussians);
  const [format, type] = [THREE.RGBAFormat, THREE.FloatType];
  const texture = new THREE.DataTexture(texels, TEXELS * PER_ROW, rows, format, type);
  texture.needsUpdate = true;
  return texture;
}

/** Those that hide what is behind them as points about their middle, for pointer and first view. */
export function solidPlaces(gaussians: Float32Array): Frame {
  const solid: number[] = []; // where they begin
  for (let i = 0; i < gaussians.length; i += NUMBERS)
    if (gaussians[i + OPACITY]! >= SOLID) solid.push(i);
  const step = Math.max(1, Math.ceil(solid.length / MOST_MET));
  const kept = solid.filter((_, k) => k % step === 0);
  const mean = (axis: number) =>
    kept.reduce((sum, i) => sum + gaussians[i + axis]!, 0) / Math.max(1, kept.length);
  const middle: Vec3 = [mean(0), mean(1), mean(2)];
  const points = new Float32Array(3 * kept.length);
  kept.forEach((i, k) => {
    for (const axis of [0, 1, 2]) points[3 * k + axis] = gaussians[i + axis]! - middle[axis]!;
  });
  const [x, y, z] = middle;
  return {
    ...{ kind: "frame", camera: 0, number: 0, stamp: 0, metresPerUnit: 1, hasRays: false },
    ...{ width: kept.length, height: 1, intrinsics: [1, 1, 0, 0], depth: null, points },
    ...{ triangles: null, colour: null },
    worldFromCamera: Float32Array.of(1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z),
  };
}

export class SplatCloud {
  readonly object: THREE.Mesh<THREE.InstancedBufferGeometry, THREE.RawShaderMaterial>;
  /** what a pointer meets of it */
  readonly seen: SeenSurface;
  /** how many are drawn */
  readonly count: number;
  private readonly step: number; // every how many-th is drawn
  private readonly order: THREE.InstancedBufferAttribute;
  private readonly depths: Uint16Array;
  private sorted: { eye: Vec3; forward: Vec3 } | null = null;
  private free = 0; // [ms] when they may be sorted again

  /** @param software  a processor draws: it has no time to mix colours, so they are solid */
  constructor(
    private readonly gaussians: Float32Array,
    private readonly software: boolean,
  ) {
    const all = gaussians.length / NUMBERS;
    this.step = software ? Math.ceil(all / MOST_IN_SOFTWARE) : 1;
    this.count = Math.floor(all / this.step);
    this.seen = new SeenSurface(solidPlaces(gaussians), null);
    this.depths = new Uint16Array(this.count);
    this.order = new THREE.InstancedBufferAttribute(new Uint32Array(this.count), 1);
    this.order.setUsage(THREE.DynamicDrawUsage);
    const corners = new Float32Array([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]);
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    geometry.setAttribute("which", this.order);
    geometry.instanceCount = this.count;
    const material = new THREE.RawShaderMaterial({
      ...{ vertexShader, fragmentShader, glslVersion: THREE.GLSL3 },
      ...(software ? { defines: { SOLID: 1 } } : { transparent: true, depthWrite: false }),
      uniforms: {
        gaussians: { value: textureOf(gaussians) },
        viewport: { value: new THREE.Vector2() },
        wider: { value: this.step },
      },
    });
    this.object = new THREE.Mesh(geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = -1;
  }

  /**
   * Before a drawing. @param distance  [m] of what is looked at @param now  [ms]
   * @return whether they are to be drawn again soon, as they could not be sorted yet
   */
  prepare(
    eye: Vec3,
    forward: Vec3,
    distance: number,
    viewport: THREE.Vector2,
    now: number,
  ): boolean {
    this.object.material.uniforms.viewport!.value.copy(viewport);
    const before = this.sorted;
    const isSorted =
      before !== null &&
      dot(before.forward, forward) > TURNED &&
      length(sub(before.eye, eye)) < MOVED * distance;
    if (isSorted) return false;
    if (now < this.free) return true;
    const begin = performance.now();
    this.sort(eye, forward);
    this.sorted = { eye, forward };
    this.free = now + REST * (performance.now() - begin);
    return false;
  }

  // By counting.
  private sort(eye: Vec3, forward: Vec3): void {
    const { gaussians } = this;
    const [fx, fy, fz] = forward;
    const from = dot(eye, forward);
    let farthest = 0;
    const depthOf = (i: number) => {
      const at = NUMBERS * this.step * i;
      return fx * gaussians[at]! + fy * gaussians[at + 1]! + fz * gaussians[at + 2]! - from;
    };
    for (let i = 0; i < this.count; ++i) farthest = Math.max(farthest, depthOf(i));
    // By the logarithm: what is near is sorted as finely as what is far.
    const nearest = 1e-3 * farthest || 1;
    const unit = (DEPTHS - 1) / Math.log(Math.max(farthest, nearest) / nearest || 1);
    const begins = new Uint32Array(DEPTHS + 1);
    for (let i = 0; i < this.count; ++i) {
      const depth = depthOf(i);
      const step = depth > nearest ? Math.min(DEPTHS - 1, unit * Math.log(depth / nearest)) : 0;
      // What is solid hides what is behind it if it is drawn first.
      this.depths[i] = this.software ? step : DEPTHS - 1 - step;
      ++begins[this.depths[i]! + 1]!;
    }
    for (let k = 0; k < DEPTHS; ++k) begins[k + 1]! += begins[k]!;
    const order = this.order.array;
    for (let i = 0; i < this.count; ++i) order[begins[this.depths[i]!]!++] = i * this.step;
    this.order.needsUpdate = true;
  }

  dispose(): void {
    this.object.geometry.dispose();
    (this.object.material.uniforms.gaussians!.value as THREE.Texture).dispose();
    this.object.material.dispose();
  }
}

// SPDX-License-Identifier: Apache-2.0
// One camera's points. The depth image goes to the graphics card as it was captured; each vertex
// deprojects its own pixel there (section 4.2 of the paper), so no thread ever walks the frame.

import * as THREE from "three";
import { length, sub } from "./camera_math";
import type { Frame, Rays, Vec3 } from "./protocol";
import { SeenSurface } from "./surface";
import { drawsFaces } from "./thinning";

const POINTS_PER_ROW = 1024;
const LEAST_POINTS = 2000; // that are drawn of an unorganised cloud, if it has as many

// Here and not in each of a point's pixels, of which software draws millions.
const COLOURS = /* glsl */ `
uniform vec2 range;            // [m] near and far colour
uniform vec3 nearColour, middleColour, farColour;
vec3 ofDepth(float z) {
  float t = clamp((z - range.x) / (range.y - range.x), 0.0, 1.0);
  return t < 0.5 ? mix(nearColour, middleColour, 2.0 * t)
                 : mix(middleColour, farColour, 2.0 * t - 1.0);
}
vec3 toLinear(vec3 c) { return pow(c, vec3(2.2)); }
vec3 toScreen(vec3 c) { return pow(c, vec3(1.0 / 2.2)); }
`;

const vertexShader = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;
#ifdef POINTS
uniform highp sampler2D points;
uniform vec2 pointSpacing;     // [m], [-] of the distance: about, between neighbours
#else
uniform usampler2D depth;
uniform vec4 intrinsics;
uniform float metresPerUnit;
#ifdef RAYS
uniform highp sampler2D rays;
#endif
#endif
uniform ivec2 size;
uniform int stride;
uniform mat4 worldFromCamera;
uniform float pixelsPerMetre;  // of the screen, at one metre
uniform float smallest;        // [px]
uniform vec3 glow;
uniform vec3 proxy;
uniform vec3 radii;            // r_1, r_3; what the paper's psi falls from and to
uniform vec3 light;
uniform bool tinted;
#ifdef TINT
uniform highp sampler2D tint;  // red, green and blue beside each other
uniform ivec2 tintSize;
uniform vec4 tintLens;         // of a colour camera; fx 0: the pixels are the depth's
uniform mat4 tintFromWorld;
#endif
out vec3 colour;

${COLOURS}
bool pointAt(ivec2 pixel, out vec3 p) {
#ifdef POINTS
  int i = pixel.y * size.x + pixel.x;
  ivec2 at = ivec2(3 * (i % ${POINTS_PER_ROW}), i / ${POINTS_PER_ROW});
  p = vec3(texelFetch(points, at, 0).r, texelFetch(points, at + ivec2(1, 0), 0).r,
           texelFetch(points, at + ivec2(2, 0), 0).r);
  return true;
#else
  if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, size))) return false;
  uint raw = texelFetch(depth, pixel, 0).r;
  if (raw == 0u || raw == 65535u) return false;
  float z = float(raw) * metresPerUnit;
#ifdef RAYS
  vec2 ray = texelFetch(rays, pixel, 0).rg;
  if (ray.x != ray.x) return false;
#else
  vec2 ray = (vec2(pixel) - intrinsics.zw) / intrinsics.xy;
#endif
  p = vec3(ray * z, z);
  return true;
#endif
}

// How much light the surface about a pixel gets: 1 where it cannot be told.
float shade(ivec2 pixel, vec3 p) {
#ifdef POINTS
  return 0.9;
#else
  const int n = 3;
  vec3 a, b, c, d;
  if (!pointAt(pixel + ivec2(n, 0), a) || !pointAt(pixel - ivec2(n, 0), b) ||
      !pointAt(pixel + ivec2(0, n), c) || !pointAt(pixel - ivec2(0, n), d)) return 0.8;
  vec3 across = a - b, down = c - d;
  if (abs(across.z) + abs(down.z) > 0.06 * p.z) return 0.7;  // an edge
  vec3 normal = normalize(cross(down, across));
  return 0.42 + 0.62 * max(dot(mat3(worldFromCamera) * normal, light), 0.0);
#endif
}

// Of the colour image; false: it does not see this place.
bool tintAt(ivec2 pixel, vec3 world, out vec3 found) {
#ifdef TINT
  int i = pixel.y * size.x + pixel.x;
  if (tintLens.x > 0.0) {
    vec3 q = (tintFromWorld * vec4(world, 1.0)).xyz;
    ivec2 at = ivec2(floor(q.xy / q.z * tintLens.xy + tintLens.zw + 0.5));
    if (q.z <= 0.0 || any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, tintSize)))
      return false;
    i = at.y * tintSize.x + at.x;
  }
  ivec2 at = ivec2(3 * (i % ${POINTS_PER_ROW}), i / ${POINTS_PER_ROW});
  found = vec3(texelFetch(tint, at, 0).r, texelFetch(tint, at + ivec2(1, 0), 0).r,
               texelFetch(tint, at + ivec2(2, 0), 0).r);
  return tinted;
#else
  return false;
#endif
}

// psi of (2)
float weight(float r) {
  if (r < radii.x) return 1.0;
  if (r >= radii.y) return 0.0;
  float s = (r - radii.x) / (radii.y - radii.x);
  return (1.0 - s) * (1.0 - s) * (1.0 - s) * (1.0 - s) * (4.0 * s + 1.0);
}

void main() {
  int columns = (size.x + stride - 1) / stride;
  ivec2 pixel = ivec2(gl_VertexID % columns, gl_VertexID / columns) * stride;
  vec3 p;
  if (!pointAt(pixel, p)) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
    return;
  }
  vec3 world = (worldFromCamera * vec4(p, 1.0)).xyz;
  gl_Position = projectionMatrix * viewMatrix * vec4(world, 1.0);

  colour = ofDepth(p.z);
  vec3 own;
  if (tintAt(pixel, world, own)) colour = toLinear(own);
  else colour *= shade(pixel, p);
  float w = weight(distance(world, proxy));
  colour = toScreen(mix(colour, glow, 0.85 * sqrt(w)));

#ifdef POINTS
  float spacing = pointSpacing.x + pointSpacing.y * length(p);
#else
  float spacing = float(stride) * p.z / intrinsics.x;
#endif
  // A little more than the gap, which is wider along a surface that is seen aslant.
  gl_PointSize = clamp(1.4 * spacing * pixelsPerMetre / gl_Position.w, smallest, 48.0);
}
`;

// A mesh's faces, in the points' colours; each face flat.
const facesVertexShader = /* glsl */ `
precision highp float;
uniform mat4 worldFromCamera;
uniform bool tinted;
#ifdef TINT
in vec3 own;
#endif
${COLOURS}
out vec3 colour;
out vec3 place;
void main() {
  place = (worldFromCamera * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
  colour = ofDepth(position.z);
#ifdef TINT
  if (tinted) colour = toLinear(own);
#endif
}
`;

const facesFragmentShader = /* glsl */ `
precision highp float;
uniform vec3 glow, proxy, radii, light;
in vec3 colour;
in vec3 place;
out vec4 fragment;
void main() {
  vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
  vec3 lit = colour * (0.36 + 0.6 * abs(dot(normal, light)));
  float near = 1.0 - smoothstep(radii.x, radii.y, distance(place, proxy));
  fragment = linearToOutputTexel(vec4(mix(lit, glow, 0.7 * near), 1.0));
}
`;

const fragmentShader = /* glsl */ `
precision mediump float;
in vec3 colour;
out vec4 fragment;
void main() {
  fragment = vec4(colour, 1.0);
}
`;

/** Uniforms that all cameras share, set before a drawing. */
export const cloudLook = () => ({
  tinted: { value: true }, // with the cameras' own colours, where they have any
  nearColour: { value: new THREE.Color() },
  middleColour: { value: new THREE.Color() },
  farColour: { value: new THREE.Color() },
  glow: { value: new THREE.Color() }, // of what shapes the proxy's normal
  proxy: { value: new THREE.Vector3() },
  radii: { value: new THREE.Vector3(0.00499, 0.01, 0) },
  light: { value: new THREE.Vector3(0, 0, 1) },
});

/** Draws a camera's newest frame. */
export class CameraCloud {
  readonly object: THREE.Points;
  /** of a mesh that is not too large; else not visible */
  readonly faces: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  range: [number, number] = [0.5, 1.5]; // [m] of the nearer and the farther points, for colours
  frame: Frame | null = null;
  seen: SeenSurface | null = null; // what the frame measured, as geometry
  private lens: Rays | null = null;
  private texture: THREE.DataTexture | null = null;
  private rays: THREE.DataTexture | null = null;
  private readonly material: THREE.ShaderMaterial;
  private measuredRange = false;
  private tint: THREE.DataTexture | null = null;
  private spacing: Spacing = [0.002, 0]; // of points without an image
  private measuredSpacing = 0; // of so many points

  constructor(look = cloudLook()) {
    this.material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader,
      fragmentShader,
      uniforms: {
        ...look,
        depth: { value: null },
        points: { value: null },
        rays: { value: null },
        intrinsics: { value: new THREE.Vector4(1, 1, 0, 0) },
        metresPerUnit: { value: 1 },
        pointSpacing: { value: new THREE.Vector2() },
        tint: { value: null },
        tintSize: { value: new THREE.Vector2(1, 1) },
        tintLens: { value: new THREE.Vector4() },
        tintFromWorld: { value: new THREE.Matrix4() },
        size: { value: new THREE.Vector2(1, 1) },
        stride: { value: 1 },
        worldFromCamera: { value: new THREE.Matrix4() },
        pixelsPerMetre: { value: 1 },
        smallest: { value: 1.5 },
        range: { value: new THREE.Vector2(0.5, 1.5) },
      },
    });
    this.object = new THREE.Points(new THREE.BufferGeometry(), this.material);
    this.faces = new THREE.Mesh(
      new THREE.BufferGeometry(),
      new THREE.ShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: facesVertexShader,
        fragmentShader: facesFragmentShader,
        uniforms: this.material.uniforms, // the same objects
        side: THREE.DoubleSide,
        // The points lie on the faces, before them.
        polygonOffset: true,
        polygonOffsetFactor: 1,
        polygonOffsetUnits: 4,
      }),
    );
    this.object.frustumCulled = this.faces.frustumCulled = false;
    this.object.visible = this.faces.visible = false;
  }

  show(frame: Frame): void {
    const uniforms = this.material.uniforms;
    const isPoints = frame.points !== null;
    this.define("POINTS", isPoints);
    this.define("RAYS", frame.hasRays);
    this.define("TINT", frame.colour !== null);
    this.texture = isPoints
      ? refilled(this.texture, padded(frame.points!), 3 * POINTS_PER_ROW, FLOATS)
      : refilled(this.texture, frame.depth!, frame.width, DEPTHS);
    uniforms.depth!.value = this.texture;
    uniforms.points!.value = this.texture;
    this.showColour(frame.colour);
    uniforms.intrinsics!.value.fromArray(frame.intrinsics);
    // It costs more than a drawing: again where another cloud has come.
    if (isPoints && Math.abs(frame.width - this.measuredSpacing) > 0.1 * this.measuredSpacing) {
      this.spacing = spacingOf(frame.points!);
      this.measuredSpacing = frame.width;
    }
    uniforms.metresPerUnit!.value = frame.metresPerUnit;
    uniforms.size!.value.set(frame.width, frame.height);
    setPose(uniforms.worldFromCamera!.value as THREE.Matrix4, frame.worldFromCamera);
    this.frame = frame;
    this.seen = new SeenSurface(frame, this.lens);
    this.object.visible = !frame.hasRays || this.rays !== null;
    this.takeFaces(frame);
    this.followRange(frame);
  }

  /** Gives back what the graphics card holds. */
  dispose(): void {
    for (const texture of [this.texture, this.rays, this.tint]) texture?.dispose();
    this.material.dispose();
    this.object.geometry.dispose();
    this.faces.geometry.dispose();
    this.faces.material.dispose();
  }

  setRays(message: Rays): void {
    this.lens = message;
    this.rays?.dispose();
    const { rays, width, height } = message;
    this.rays = new THREE.DataTexture(rays, width, height, THREE.RGFormat, THREE.FloatType);
    this.rays.needsUpdate = true;
    this.material.uniforms.rays!.value = this.rays;
  }

  /** Sets what the next drawing needs. @param stride every how many-th pixel, both ways */
  prepare(stride: number, pixelsPerMetre: number, pixelRatio: number): void {
    if (!this.frame) return;
    const uniforms = this.material.uniforms;
    uniforms.stride!.value = stride;
    uniforms.pixelsPerMetre!.value = pixelsPerMetre;
    uniforms.smallest!.value = 1.5 * pixelRatio;
    uniforms.range!.value.fromArray(this.range);
    const faces = (this.frame.triangles?.length ?? 0) / 3;
    this.faces.visible = faces > 0 && drawsFaces(faces, stride);
    if (this.frame.points) {
      // Of a mesh, the faces show what is between its corners.
      // They have no rows: one of as many of them as of an image's pixels, but some always.
      const most = Math.max(1, Math.floor(this.frame.width / LEAST_POINTS));
      uniforms.stride!.value = stride = Math.min(stride * stride, most);
      const wider = this.faces.visible ? 0 : Math.sqrt(stride);
      uniforms.pointSpacing!.value.set(wider * this.spacing[0], wider * this.spacing[1]);
    }
    const columns = Math.ceil(this.frame.width / stride);
    const rows = Math.ceil(this.frame.height / stride);
    this.object.geometry.setDrawRange(0, columns * rows);
  }

  /** Has it colours of its own? */
  get hasColour(): boolean {
    return this.frame?.colour != null;
  }

  /** [m] between what is measured about a place of the world. */
  spacingAt(place: Vec3): number {
    const away = length(sub(place, this.seen?.eye ?? place));
    if (this.frame?.points) return this.spacing[0] + this.spacing[1] * away;
    return away / (this.frame?.intrinsics[0] ?? 1);
  }

  // `prepare` says whether they are drawn.
  private takeFaces({ points, triangles, colour }: Frame): void {
    if (!triangles) {
      this.faces.visible = false;
      return;
    }
    const { geometry } = this.faces;
    geometry.dispose(); // another's buffers
    geometry.setAttribute("position", new THREE.BufferAttribute(points!, 3));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    if (colour && !colour.camera)
      geometry.setAttribute("own", new THREE.BufferAttribute(colour.rgb, 3, true));
  }

  private showColour(colour: Frame["colour"]): void {
    if (!colour) return;
    const { tint, tintSize, tintLens, tintFromWorld } = this.material.uniforms;
    this.tint = refilled(this.tint, padded(colour.rgb), 3 * POINTS_PER_ROW, BYTES);
    tint!.value = this.tint;
    tintSize!.value.set(colour.width, colour.height);
    tintLens!.value.fromArray(colour.camera?.intrinsics ?? [0, 0, 0, 0]);
    if (colour.camera) setPose(tintFromWorld!.value, colour.camera.cameraFromWorld);
  }

  private define(name: string, wanted: boolean): void {
    for (const material of [this.material, this.faces.material]) {
      const defines = (material.defines ??= {});
      if (wanted === name in defines) continue;
      if (wanted) defines[name] = "";
      else delete defines[name];
      material.needsUpdate = true;
    }
  }

  // The colours' ends follow the 2nd and 98th of a hundred readings spread over the frame.
  private followRange(frame: Frame): void {
    const depths: number[] = [];
    const count = frame.width * frame.height;
    const step = Math.max(1, Math.floor(count / 997));
    for (let i = 0; i < count; i += step) {
      const raw = frame.depth ? frame.depth[i]! : 0;
      if (frame.points) depths.push(frame.points[3 * i + 2]!);
      else if (raw !== 0 && raw !== 65535) depths.push(raw * frame.metresPerUnit);
    }
    if (depths.length < 10) return;
    depths.sort((a, b) => a - b);
    const near = depths[Math.floor(0.02 * depths.length)]!;
    const far = Math.max(depths[Math.floor(0.98 * depths.length)]!, near + 0.02);
    const rate = this.measuredRange ? 0.05 : 1;
    this.range = [
      this.range[0] + rate * (near - this.range[0]),
      this.range[1] + rate * (far - this.range[1]),
    ];
    this.measuredRange = true;
  }
}

/** Between neighbours: [m], and of the distance from the sensor [-]; one of them is 0. */
type Spacing = readonly [number, number];

const SPACING_SAMPLES = 200;
const SPACING_READINGS = 1e7;

/**
 * About, from the fourth nearest of some points, which is as far in a grid as where they lie by
 * chance. A scanner that turns sees the farther the sparser: whichever fits better is taken.
 */
export function spacingOf(points: Float32Array): Spacing {
  const count = Math.floor(points.length / 3);
  if (count < 6) return [0.002, 0];
  const samples = Math.max(8, Math.min(SPACING_SAMPLES, Math.floor(SPACING_READINGS / count)));
  const step = Math.max(1, Math.floor(count / samples));
  const [fixed, growing]: [number[], number[]] = [[], []];
  for (let i = 0; i < count; i += step) {
    const [x, y, z] = [points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!];
    const least = [Infinity, Infinity, Infinity, Infinity]; // squares, the largest last
    for (let k = 0; k < points.length; k += 3) {
      const square = (points[k]! - x) ** 2 + (points[k + 1]! - y) ** 2 + (points[k + 2]! - z) ** 2;
      // Of points that are there twice, one.
      if (!(square > 0 && square < least[3]!)) continue;
      least[3] = square;
      for (let at = 3; at > 0 && least[at]! < least[at - 1]!; --at)
        [least[at], least[at - 1]] = [least[at - 1]!, least[at]!];
    }
    const away = Math.hypot(x, y, z);
    if (!(least[3]! < Infinity && away > 0)) continue;
    fixed.push(Math.sqrt(least[3]!));
    growing.push(Math.sqrt(least[3]!) / away);
  }
  if (fixed.length === 0) return [0.002, 0];
  const [one, other] = [fixed, growing].map((values) => {
    const sorted = values.sort((a, b) => a - b);
    const at = (share: number) => sorted[Math.floor(share * (sorted.length - 1))]!;
    return { middle: at(0.5), spread: at(0.9) / at(0.1) };
  }) as [{ middle: number; spread: number }, { middle: number; spread: number }];
  return other.spread < 0.7 * one.spread ? [0, other.middle] : [one.middle, 0];
}

function setPose(to: THREE.Matrix4, pose: ArrayLike<number>): void {
  const m = [...Array.from(pose), 0, 0, 0, 1] as Parameters<THREE.Matrix4["set"]>;
  to.set(...m);
}

interface Texels {
  format: THREE.PixelFormat;
  type: THREE.TextureDataType;
  internal: THREE.PixelFormatGPU;
}
const DEPTHS: Texels = {
  ...{ format: THREE.RedIntegerFormat, type: THREE.UnsignedShortType, internal: "R16UI" },
};
const FLOATS: Texels = { format: THREE.RedFormat, type: THREE.FloatType, internal: "R32F" };
const BYTES: Texels = { format: THREE.RedFormat, type: THREE.UnsignedByteType, internal: "R8" };

// The same texture with other data, or another where they do not fit it.
function refilled(
  texture: THREE.DataTexture | null,
  data: Uint16Array | Float32Array | Uint8Array,
  width: number,
  { format, type, internal }: Texels,
): THREE.DataTexture {
  const height = data.length / width;
  const { image } = texture ?? {};
  if (image?.width !== width || image.height !== height || texture?.internalFormat !== internal) {
    texture?.dispose();
    texture = new THREE.DataTexture(null, width, height, format, type);
    texture.internalFormat = internal;
  }
  texture!.image = { data: data as unknown as Uint8Array<ArrayBuffer>, width, height };
  texture!.needsUpdate = true;
  return texture!;
}

// Whole rows of a texture; what is beyond is never drawn.
function padded<Numbers extends Float32Array | Uint8Array>(numbers: Numbers): Numbers {
  const row = 3 * POINTS_PER_ROW;
  const size = Math.max(1, Math.ceil(numbers.length / row)) * row;
  if (numbers.length === size) return numbers;
  const made = new (numbers.constructor as new (size: number) => Numbers)(size);
  made.set(numbers);
  return made;
}

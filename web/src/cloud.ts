// SPDX-License-Identifier: Apache-2.0
// One camera's points. The depth image goes to the graphics card as it was captured; each vertex
// deprojects its own pixel there (section 4.2 of the paper), so no thread ever walks the frame.

import * as THREE from "three";
import type { Vec3 } from "./protocol";
import type { Frame, Rays } from "./protocol";
import { SeenSurface } from "./surface";
import { drawsFaces } from "./thinning";

const POINTS_PER_ROW = 1024;
const LEAST_POINTS = 2000; // that are drawn of an unorganised cloud, if it has as many

const vertexShader = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;
#ifdef POINTS
uniform highp sampler2D points;
uniform float pointSpacing;    // [m] about, between neighbours
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
uniform vec2 range;            // [m] near and far colour
uniform vec3 nearColour, middleColour, farColour, glow;
uniform vec3 proxy;
uniform vec3 radii;            // r_1, r_3; what the paper's psi falls from and to
uniform vec3 light;
out vec3 colour;

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

  float t = clamp((p.z - range.x) / (range.y - range.x), 0.0, 1.0);
  colour = t < 0.5 ? mix(nearColour, middleColour, 2.0 * t)
                   : mix(middleColour, farColour, 2.0 * t - 1.0);
  colour *= shade(pixel, p);
  float w = weight(distance(world, proxy));
  colour = mix(colour, glow, 0.85 * sqrt(w));

#ifdef POINTS
  float spacing = pointSpacing;
#else
  float spacing = float(stride) * p.z / intrinsics.x;
#endif
  gl_PointSize = clamp(1.7 * spacing * pixelsPerMetre / gl_Position.w, smallest, 48.0);
}
`;

// A mesh's faces, in the points' colours; each face flat.
const facesVertexShader = /* glsl */ `
precision highp float;
uniform mat4 worldFromCamera;
uniform vec2 range;
uniform vec3 nearColour, middleColour, farColour;
out vec3 colour;
out vec3 place;
void main() {
  place = (worldFromCamera * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
  float t = clamp((position.z - range.x) / (range.y - range.x), 0.0, 1.0);
  colour = t < 0.5 ? mix(nearColour, middleColour, 2.0 * t)
                   : mix(middleColour, farColour, 2.0 * t - 1.0);
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
precision highp float;
in vec3 colour;
out vec4 fragment;
void main() {
  vec2 d = gl_PointCoord - 0.5;
  if (dot(d, d) > 0.25) discard;
  fragment = linearToOutputTexel(vec4(colour, 1.0));
}
`;

function nearest(texture: THREE.DataTexture): THREE.DataTexture {
  texture.minFilter = THREE.NearestFilter;
  texture.magFilter = THREE.NearestFilter;
  texture.generateMipmaps = false;
  return texture;
}

export interface CloudColours {
  near: THREE.Color;
  middle: THREE.Color;
  far: THREE.Color;
  glow: THREE.Color;
}

/** Draws a camera's newest frame. */
export class CameraCloud {
  readonly object: THREE.Points;
  /** of a mesh that is not too large; else not visible */
  readonly faces: THREE.Mesh<THREE.BufferGeometry, THREE.ShaderMaterial>;
  /** [m] of the nearer and the farther points, for colours */
  range: [number, number] = [0.5, 1.5];
  frame: Frame | null = null;
  /** what the frame measured, as geometry */
  seen: SeenSurface | null = null;
  private lens: Rays | null = null;
  private texture: THREE.DataTexture | null = null;
  private rays: THREE.DataTexture | null = null;
  private readonly material: THREE.ShaderMaterial;
  private measuredRange = false;
  private spacing = 0; // [m] about, between neighbours of points without an image

  constructor() {
    this.material = new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader,
      fragmentShader,
      uniforms: {
        depth: { value: null },
        points: { value: null },
        rays: { value: null },
        intrinsics: { value: new THREE.Vector4(1, 1, 0, 0) },
        metresPerUnit: { value: 1 },
        pointSpacing: { value: 0.002 },
        size: { value: new THREE.Vector2(1, 1) },
        stride: { value: 1 },
        worldFromCamera: { value: new THREE.Matrix4() },
        pixelsPerMetre: { value: 1 },
        smallest: { value: 1.5 },
        range: { value: new THREE.Vector2(0.5, 1.5) },
        nearColour: { value: new THREE.Color() },
        middleColour: { value: new THREE.Color() },
        farColour: { value: new THREE.Color() },
        glow: { value: new THREE.Color() },
        proxy: { value: new THREE.Vector3(0, 0, 1e6) },
        radii: { value: new THREE.Vector3(0.00499, 0.01, 0) },
        light: { value: new THREE.Vector3(0, 0, 1) },
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
    if (isPoints) this.upload(paddedPoints(frame.points!), 3 * POINTS_PER_ROW, false);
    else this.upload(frame.depth!, frame.width, true);
    uniforms.depth!.value = this.texture;
    uniforms.points!.value = this.texture;
    uniforms.intrinsics!.value.fromArray(frame.intrinsics);
    if (isPoints) this.spacing = spacingOf(frame.points!);
    uniforms.metresPerUnit!.value = frame.metresPerUnit;
    uniforms.size!.value.set(frame.width, frame.height);
    const pose = frame.worldFromCamera;
    // prettier-ignore
    uniforms.worldFromCamera!.value.set(
      pose[0], pose[1], pose[2], pose[3], pose[4], pose[5], pose[6], pose[7],
      pose[8], pose[9], pose[10], pose[11], 0, 0, 0, 1);
    this.frame = frame;
    this.seen = new SeenSurface(frame, this.lens);
    this.object.visible = !frame.hasRays || this.rays !== null;
    this.takeFaces(frame);
    this.followRange(frame);
  }

  /** Gives back what the graphics card holds. */
  dispose(): void {
    this.texture?.dispose();
    this.rays?.dispose();
    this.material.dispose();
    this.object.geometry.dispose();
    this.faces.geometry.dispose();
    this.faces.material.dispose();
  }

  setRays(message: Rays): void {
    this.lens = message;
    this.rays?.dispose();
    this.rays = nearest(
      new THREE.DataTexture(
        message.rays,
        message.width,
        message.height,
        THREE.RGFormat,
        THREE.FloatType,
      ),
    );
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
      uniforms.pointSpacing!.value = this.faces.visible ? 0 : this.spacing;
      // They have no rows: one of as many of them as of an image's pixels, but some always.
      const most = Math.max(1, Math.floor(this.frame.width / LEAST_POINTS));
      uniforms.stride!.value = stride = Math.min(stride * stride, most);
    }
    const columns = Math.ceil(this.frame.width / stride);
    const rows = Math.ceil(this.frame.height / stride);
    this.object.geometry.setDrawRange(0, columns * rows);
  }

  setProxy(at: Vec3, r1: number, r3: number): void {
    this.material.uniforms.proxy!.value.fromArray(at);
    this.material.uniforms.radii!.value.set(r1, r3, 0);
  }

  setLight(direction: Vec3): void {
    this.material.uniforms.light!.value.fromArray(direction);
  }

  setColours(colours: CloudColours): void {
    this.material.uniforms.nearColour!.value = colours.near;
    this.material.uniforms.middleColour!.value = colours.middle;
    this.material.uniforms.farColour!.value = colours.far;
    this.material.uniforms.glow!.value = colours.glow;
  }

  // `prepare` says whether they are drawn.
  private takeFaces({ points, triangles }: Frame): void {
    if (!triangles) {
      this.faces.visible = false;
      return;
    }
    const { geometry } = this.faces;
    geometry.dispose(); // another's buffers
    geometry.setAttribute("position", new THREE.BufferAttribute(points!, 3));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  }

  private define(name: string, wanted: boolean): void {
    const defines = (this.material.defines ??= {});
    if (wanted === name in defines) return;
    if (wanted) defines[name] = "";
    else delete defines[name];
    this.material.needsUpdate = true;
  }

  private upload(data: Uint16Array | Float32Array, width: number, isDepth: boolean): void {
    const height = data.length / width;
    const fits = this.texture?.image.width === width && this.texture.image.height === height;
    if (!fits || this.texture!.userData.isDepth !== isDepth) {
      this.texture?.dispose();
      this.texture = nearest(
        isDepth
          ? new THREE.DataTexture(
              null,
              width,
              height,
              THREE.RedIntegerFormat,
              THREE.UnsignedShortType,
            )
          : new THREE.DataTexture(null, width, height, THREE.RedFormat, THREE.FloatType),
      );
      this.texture.internalFormat = isDepth ? "R16UI" : "R32F";
      this.texture.userData.isDepth = isDepth;
    }
    this.texture!.image = { data: data as unknown as Uint8Array<ArrayBuffer>, width, height };
    this.texture!.needsUpdate = true;
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

// [m] between neighbours, about: as of a square sheet of that many points.
function spacingOf(points: Float32Array): number {
  const count = points.length / 3;
  if (count < 2) return 0.002;
  const step = 3 * Math.max(1, Math.floor(count / 500));
  const sides = [0, 1, 2].map((i) => {
    const sorted = [...Array(Math.ceil(points.length / step)).keys()]
      .map((k) => points[k * step + i]!)
      .sort((a, b) => a - b);
    return sorted[Math.floor(0.97 * sorted.length)]! - sorted[Math.floor(0.03 * sorted.length)]!;
  });
  return Math.max(0.0005, Math.hypot(...sides) / Math.sqrt(2 * count));
}

// Whole rows of a texture; the points beyond are never drawn.
function paddedPoints(points: Float32Array): Float32Array {
  const row = 3 * POINTS_PER_ROW;
  const padded = new Float32Array(Math.max(1, Math.ceil(points.length / row)) * row);
  padded.set(points);
  return padded;
}

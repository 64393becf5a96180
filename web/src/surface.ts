// SPDX-License-Identifier: Apache-2.0
// The surface that a camera measured, as geometry: where a ray of the eye meets it, its normal, and
// what is measured on the camera's sightline through a point.

import { Ray, Vector3 } from "three";
import { add, clamp, cross, dot, horizon, length, posed, scale, sub, unit } from "./camera_math";
import type { Frame, Rays, Vec3 } from "./protocol";

/** A place on a surface. */
export interface Spot {
  readonly at: Vec3; // [m, world]
  readonly normal: Vec3; // [-] unit, away from the surface
}

const STEPS = 1500; // of a ray through a depth image
const BISECTIONS = 24;
const FOOTPRINT = 0.012; // [m] about a place, whose points give its normal
const WINDOW = [2, 12] as const; // [px] least and most of the footprint, to each side
const CONE = 0.006; // [rad] about a ray, in which it meets points that have no image: six pixels
const LEAST_CONE = 0.003; // [m]
const WIDER = [1, 2, 4]; // cones that are looked at in turn, where points are sparse
const LEAST_POINTS = 6; // that give a normal
const NEAREST = 0.02; // [m] depth
const ALIKE = 0.5; // cosine between normals of faces that are averaged

/**
 * The plane through points near `at`, by least squares of their heights along `towards` (unit).
 * Gives the place of the plane above `at`, and its normal on the side of `towards`.
 */
export function fitPlane(points: readonly Vec3[], at: Vec3, towards: Vec3): Spot {
  if (points.length < LEAST_POINTS) return { at, normal: towards };
  const [e, f] = horizon(towards);
  let [mx, my, mh] = [0, 0, 0];
  const rows = points.map((point) => {
    const away = sub(point, at);
    const row = [dot(away, e), dot(away, f), dot(away, towards)] as const;
    mx += row[0] / points.length;
    my += row[1] / points.length;
    mh += row[2] / points.length;
    return row;
  });
  let [xx, xy, yy, xh, yh] = [0, 0, 0, 0, 0];
  for (const [x, y, h] of rows) {
    xx += (x - mx) ** 2;
    xy += (x - mx) * (y - my);
    yy += (y - my) ** 2;
    xh += (x - mx) * (h - mh);
    yh += (y - my) * (h - mh);
  }
  const determinant = xx * yy - xy * xy;
  if (!(determinant > 1e-6 * (xx + yy) ** 2)) return { at, normal: towards }; // in a line
  const a = (xh * yy - yh * xy) / determinant;
  const b = (yh * xx - xh * xy) / determinant;
  return {
    at: add(at, scale(towards, mh - a * mx - b * my)),
    normal: unit(sub(towards, add(scale(e, a), scale(f, b)))),
  };
}

/** Where a ray meets a spot's plane; null if it runs along it or away from it. */
export function onPlane(from: Vec3, along: Vec3, spot: Spot): Vec3 | null {
  const falls = -dot(along, spot.normal);
  const height = dot(sub(from, spot.at), spot.normal);
  return falls > 0.05 && height > 0 ? add(from, scale(along, height / falls)) : null;
}

/** One frame of a camera. All places are in the world [m]. */
export class SeenSurface {
  readonly eye: Vec3; // where the camera is
  private readonly pose: ArrayLike<number>;
  private farthestDepth: number | null = null;

  /** @param rays  of a distorted lens */
  constructor(private readonly frame: Frame, private readonly rays: Rays | null) {
    this.pose = frame.worldFromCamera;
    this.eye = [this.pose[3]!, this.pose[7]!, this.pose[11]!];
  }

  /** where the camera looks, unit */
  get forward(): Vec3 {
    return [this.pose[2]!, this.pose[6]!, this.pose[10]!];
  }

  /** How many points without an image there are; 0: there is an image. */
  get unordered(): number {
    return this.frame.points ? this.frame.width : 0;
  }

  /** Places spread evenly over what the frame measured; of holes there are none. */
  places(about: number): Vec3[] {
    const { width, height, points } = this.frame;
    const count = width * height;
    const step = Math.max(1, Math.floor(count / about));
    const found: Vec3[] = [];
    for (let i = 0; i < count; i += step) {
      const p = points
        ? ([points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!] as const)
        : this.deproject(i % width, Math.floor(i / width));
      if (p) found.push(this.toWorld(p));
    }
    return found;
  }

  /** The normal at a measured place, towards the camera, from what is within `radius` [m]. */
  normalAt(place: Vec3, radius: number): Vec3 {
    return fitPlane(this.around(place, radius), place, unit(sub(this.eye, place))).normal;
  }

  /** The measured place on the sightline through `point`; null: none is. */
  onSightline(point: Vec3): Vec3 | null {
    const p = this.toCamera(point);
    const depth = this.depthBefore(p);
    return depth === null ? null : this.toWorld(scale(p, depth / p[2]));
  }

  /** Where a ray (`along`: unit) first meets the surface, and how far along it. */
  meet(from: Vec3, along: Vec3): { spot: Spot; distance: number } | null {
    const start = this.toCamera(from);
    const direction = this.turnedToCamera(along);
    const face = this.frame.triangles && this.meetFaces(start, direction);
    if (face) {
      const at = add(from, scale(along, face.distance));
      const normal = sub(this.toWorld(face.normal), this.eye);
      return { spot: { at, normal }, distance: face.distance };
    }
    const distance = this.frame.points
      ? this.meetPoints(start, direction)
      : this.meetImage(start, direction);
    if (distance === null) return null;
    const raw = add(from, scale(along, distance));
    const towards = this.frame.points ? scale(along, -1) : unit(sub(this.eye, raw));
    const fitted = fitPlane(this.around(raw), raw, towards);
    const at = onPlane(from, along, fitted);
    // Noise or an edge may tilt the plane so that the ray meets it elsewhere.
    const close = at !== null && length(sub(at, raw)) < FOOTPRINT;
    return { spot: { at: close ? at : raw, normal: fitted.normal }, distance };
  }

  /** How far along a ray (`along`: unit) the first of points without an image is; null: none is. */
  firstPoint(from: Vec3, along: Vec3): number | null {
    return this.meetPoints(this.toCamera(from), this.turnedToCamera(along));
  }

  private meetImage(start: Vec3, direction: Vec3): number | null {
    const reach = length(start) + 1.5 * this.farthest();
    const place = (t: number): Vec3 => add(start, scale(direction, t));
    // How far behind the surface the ray is, along the optical axis; null: nothing is measured.
    const behind = (t: number): number | null => {
      const p = place(t);
      const depth = this.depthBefore(p);
      return depth === null ? null : p[2] - depth;
    };
    let before: number | null = null; // a place on the ray in front of the surface
    for (let i = 0; i <= STEPS; ++i) {
      const t = (i / STEPS) * reach;
      const now = behind(t);
      if (now === null) continue;
      if (now < 0) {
        before = t;
        continue;
      }
      if (before === null) continue; // it came from behind, where nobody sees
      let [low, high] = [before, t];
      for (let k = 0; k < BISECTIONS; ++k) {
        const middle = 0.5 * (low + high);
        if ((behind(middle) ?? -1) < 0) low = middle;
        else high = middle;
      }
      // A step of the depth is an edge, behind which the ray goes on unseen.
      if (behind(high)! < Math.max(0.004, 0.015 * place(high)[2])) return high;
      before = null;
    }
    return null;
  }

  // The first face on a ray, from either side, and its normal towards the ray's start.
  private meetFaces(start: Vec3, direction: Vec3): { distance: number; normal: Vec3 } | null {
    const points = this.frame.points!;
    const corners = this.frame.triangles!;
    const ray = new Ray(new Vector3(...start), new Vector3(...direction));
    const [a, b, c, hit] = [new Vector3(), new Vector3(), new Vector3(), new Vector3()];
    let [distance, met] = [Infinity, -1];
    for (let i = 0; i + 2 < corners.length; i += 3) {
      a.fromArray(points, 3 * corners[i]!);
      b.fromArray(points, 3 * corners[i + 1]!);
      c.fromArray(points, 3 * corners[i + 2]!);
      if (!ray.intersectTriangle(a, b, c, false, hit)) continue;
      const t = hit.distanceTo(ray.origin);
      if (t > NEAREST && t < distance) [distance, met] = [t, i];
    }
    if (met < 0) return null;
    const at = add(start, scale(direction, distance));
    return { distance, normal: this.normalOfFaces(met, at, direction) };
  }

  // The mean normal of a face and those about a place on it, against `along`: small faces of a scan
  // point anywhere. Faces count by their area, up to that of the footprint.
  private normalOfFaces(face: number, at: Vec3, along: Vec3): Vec3 {
    const points = this.frame.points!;
    const corners = this.frame.triangles!;
    const corner = (i: number): Vec3 => {
      const k = 3 * corners[i]!;
      return [points[k]!, points[k + 1]!, points[k + 2]!];
    };
    const areaNormal = (i: number): Vec3 =>
      cross(sub(corner(i + 1), corner(i)), sub(corner(i + 2), corner(i)));
    const own = areaNormal(face);
    const normal = unit(dot(own, along) > 0 ? scale(own, -1) : own);
    // [m] of a face's middle from the place, along an axis
    const away = (i: number, axis: 0 | 1 | 2): number =>
      (points[3 * corners[i]! + axis]! +
        points[3 * corners[i + 1]! + axis]! +
        points[3 * corners[i + 2]! + axis]!) /
        3 -
      at[axis];
    let sum: Vec3 = [0, 0, 0];
    for (let i = 0; i + 2 < corners.length; i += 3) {
      if (i !== face) {
        const x = away(i, 0);
        if (!(Math.abs(x) < FOOTPRINT)) continue; // of nearly all
        if (!(Math.hypot(x, away(i, 1), away(i, 2)) < FOOTPRINT)) continue;
      }
      const other = areaNormal(i);
      const area = length(other);
      const facing = dot(other, normal);
      if (!(Math.abs(facing) > ALIKE * area)) continue; // also of no area
      const counts = Math.min(1, FOOTPRINT ** 2 / area);
      sum = add(sum, scale(other, facing > 0 ? counts : -counts));
    }
    return unit(sum);
  }

  private meetPoints(start: Vec3, direction: Vec3): number | null {
    const points = this.frame.points!;
    const nearest = WIDER.map(() => Infinity);
    for (let i = 0; i + 2 < points.length; i += 3) {
      const x = points[i]! - start[0];
      const y = points[i + 1]! - start[1];
      const z = points[i + 2]! - start[2];
      const t = x * direction[0] + y * direction[1] + z * direction[2];
      if (!(t > NEAREST) || t >= nearest[0]!) continue;
      const off = Math.sqrt(Math.max(0, x * x + y * y + z * z - t * t));
      const radius = Math.max(LEAST_CONE, CONE * t);
      for (const [k, wider] of WIDER.entries())
        if (off < wider * radius) nearest[k] = Math.min(nearest[k]!, t);
    }
    return nearest.find(Number.isFinite) ?? null;
  }

  // The measured points near a place.
  private around(place: Vec3, radius = FOOTPRINT): Vec3[] {
    const found: Vec3[] = [];
    const at = this.toCamera(place);
    if (this.frame.points) {
      const points = this.frame.points;
      for (let i = 0; i + 2 < points.length; i += 3) {
        const p: Vec3 = [points[i]!, points[i + 1]!, points[i + 2]!];
        if (length(sub(p, at)) < radius) found.push(this.toWorld(p));
      }
      return found;
    }
    const pixel = this.pixelOf(at);
    if (!pixel) return found;
    const half = clamp(Math.round((radius * this.frame.intrinsics[0]) / at[2]), ...WINDOW);
    const step = Math.max(1, Math.round(half / 6));
    const thick = Math.max(0.02, 0.015 * at[2]); // [m] beyond it is another surface
    for (let v = -half; v <= half; v += step) {
      for (let u = -half; u <= half; u += step) {
        const p = this.deproject(pixel[0] + u, pixel[1] + v);
        if (p && Math.abs(p[2] - at[2]) < thick) found.push(this.toWorld(p));
      }
    }
    return found;
  }

  // [m] depth that is measured at the pixel of a place before the camera, or beside it in a hole.
  private depthBefore(p: Vec3): number | null {
    if (!this.frame.depth || p[2] <= NEAREST) return null;
    const pixel = this.pixelOf(p);
    if (!pixel) return null;
    for (const [u, v] of NEIGHBOURS) {
      const depth = this.depthAt(pixel[0] + u, pixel[1] + v);
      if (depth !== null) return depth;
    }
    return null;
  }

  private depthAt(u: number, v: number): number | null {
    const { width, height, depth, metresPerUnit } = this.frame;
    if (u < 0 || v < 0 || u >= width || v >= height) return null;
    const raw = depth![v * width + u]!;
    return raw === 0 || raw === 65535 ? null : raw * metresPerUnit;
  }

  private deproject(u: number, v: number): Vec3 | null {
    const depth = this.depthAt(u, v);
    if (depth === null) return null;
    const [x, y] = this.rayOf(u, v);
    return Number.isNaN(x) ? null : [x * depth, y * depth, depth];
  }

  // x and y of a pixel's ray (x, y, 1).
  private rayOf(u: number, v: number): [number, number] {
    const [fx, fy, cx, cy] = this.frame.intrinsics;
    if (!this.rays) return [(u - cx) / fx, (v - cy) / fy];
    const at = 2 * (v * this.rays.width + u);
    return [this.rays.rays[at]!, this.rays.rays[at + 1]!];
  }

  private pixelOf(p: Vec3): [number, number] | null {
    if (this.frame.hasRays && !this.rays) return null;
    const { width, height, intrinsics } = this.frame;
    const [fx, fy, cx, cy] = intrinsics;
    const x = p[0] / p[2];
    const y = p[1] / p[2];
    let u = x * fx + cx;
    let v = y * fy + cy;
    // A distorted lens: from the pixel's own ray to the wanted one, again and again.
    for (let i = 0; this.rays && i < 6; ++i) {
      const [rx, ry] = this.rayOf(
        clamp(Math.round(u), 0, width - 1),
        clamp(Math.round(v), 0, height - 1),
      );
      if (Number.isNaN(rx)) return null;
      u += (x - rx) * fx;
      v += (y - ry) * fy;
    }
    u = Math.round(u);
    v = Math.round(v);
    return u < 0 || v < 0 || u >= width || v >= height ? null : [u, v];
  }

  // [m] the largest of a thousand depths spread over the image.
  private farthest(): number {
    if (this.farthestDepth !== null) return this.farthestDepth;
    const { depth, metresPerUnit } = this.frame;
    let most = 0;
    const step = Math.max(1, Math.floor(depth!.length / 997));
    for (let i = 0; i < depth!.length; i += step)
      if (depth![i] !== 65535) most = Math.max(most, depth![i]!);
    return (this.farthestDepth = 1.2 * most * metresPerUnit);
  }

  private toWorld(p: Vec3): Vec3 {
    return posed(this.pose, p);
  }

  private toCamera(p: Vec3): Vec3 {
    return this.turnedToCamera(sub(p, this.eye));
  }

  private turnedToCamera(v: Vec3): Vec3 {
    const m = this.pose;
    return [0, 1, 2].map(
      (column) => m[column]! * v[0] + m[column + 4]! * v[1] + m[column + 8]! * v[2],
    ) as unknown as Vec3;
  }
}

// A pixel, and those about it, the nearest first.
const NEIGHBOURS: readonly (readonly [number, number])[] = [-2, -1, 0, 1, 2]
  .flatMap((v) => [-2, -1, 0, 1, 2].map((u) => [u, v] as const))
  .sort((a, b) => Math.hypot(...a) - Math.hypot(...b));

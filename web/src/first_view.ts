// SPDX-License-Identifier: Apache-2.0
// From where a scene is looked at first: near its camera, high enough above its largest plane to
// see that plane as one, and so far that what was measured fills the free part of the window.

import {
  add, axes, clamp, dot, length, lookAt, metresPerPixel, scale, sub, turned, unit, upFromPose,
  type Orbit,
} from "./camera_math";
import type { Vec3 } from "./protocol";
import type { SeenSurface } from "./surface";

/** The window [px], and the part of it that nothing lies over. */
export interface Room {
  readonly width: number;
  readonly height: number;
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

/** Where the middle of the free part is [px], right of and below the window's. */
export function offCentre(room: Room): { x: number; y: number } {
  return {
    x: 0.5 * (room.left + room.right - room.width),
    y: 0.5 * (room.top + room.bottom - room.height),
  };
}

const PLACES = 1500; // of each camera, that the view is to hold
const NORMALS = 240; // of each camera, that tell planes
const READINGS = 2e7; // of points without an image, that normals may cost
const FOOTPRINT = 0.03; // of the distance: what gives a normal
const ALIKE = Math.cos((15 * Math.PI) / 180); // normals of one plane
const LEAST_SHARE = 0.2; // of all that is seen, that makes a plane the scene's own
const LEVEL = Math.cos((65 * Math.PI) / 180); // a plane that leans less than this may be the ground
const FLATTEST = (30 * Math.PI) / 180; // at which a plane is looked at
const ASIDE = (17 * Math.PI) / 180; // from the camera's own view, to show depth
const NEAR = 3; // times as far as the nearest quarter: what is farther would make all else small
const HELD = 0.95; // of the places, that the view holds
const HELD_OF_THINGS = 0.995; // likewise, where nobody's view cuts them off
const FILLED = 0.92; // of the free part
const LEAST_REACH = 0.05; // [m] that a view shows

function quantile(values: readonly number[], share: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.round(share * (sorted.length - 1))]!;
}

const spread = (values: readonly number[]): [number, number] => [
  quantile(values, 0.03),
  quantile(values, 0.97),
];

interface Facet {
  readonly normal: Vec3;
  readonly area: number;
}

/** The normal that most of the area has; null: no plane is large. */
export function largestPlane(
  facets: readonly Facet[],
  counts: (normal: Vec3) => boolean = () => true,
): Vec3 | null {
  const total = facets.reduce((sum, { area }) => sum + area, 0);
  let best: { sum: Vec3; area: number } | null = null;
  for (const { normal } of facets) {
    if (!counts(normal)) continue;
    let [sum, area]: [Vec3, number] = [[0, 0, 0], 0];
    for (const other of facets) {
      if (dot(other.normal, normal) < ALIKE) continue;
      sum = add(sum, scale(other.normal, other.area));
      area += other.area;
    }
    if (!best || area > best.area) best = { sum, area };
  }
  return best && best.area > LEAST_SHARE * total ? unit(best.sum) : null;
}

function facetsOf(seen: SeenSurface): Facet[] {
  const about = Math.min(NORMALS, Math.ceil(READINGS / Math.max(1, seen.unordered)));
  return seen.places(about).map((place) => {
    const distance = length(sub(place, seen.eye));
    const normal = seen.normalAt(place, FOOTPRINT * distance);
    // What a pixel covers grows with its distance, and with how flatly it is looked at.
    const facing = Math.max(0.15, dot(normal, unit(sub(seen.eye, place))));
    return { normal, area: seen.unordered ? 1 : distance ** 2 / facing };
  });
}

/** The eye, moved so that a share of places fills the free part of a window. */
export function framed(orbit: Orbit, places: readonly Vec3[], room: Room, held = HELD): Orbit {
  const { right, up, forward } = axes(orbit);
  const pixel = metresPerPixel(1, room.height);
  const wide = 0.5 * FILLED * Math.max(room.right - room.left, 40) * pixel; // at one metre
  const high = 0.5 * FILLED * Math.max(room.bottom - room.top, 40) * pixel;
  let { target, distance } = orbit;
  for (let round = 0; round < 8; ++round) {
    const seen = places.map((place) => {
      const away = sub(place, target);
      return [dot(away, right), dot(away, up), dot(away, forward)] as const;
    });
    const needed = seen.map(([x, y, z]) => Math.max(Math.abs(x) / wide, Math.abs(y) / high) - z);
    const least = LEAST_REACH / Math.min(wide, high);
    distance = Math.max(quantile(needed, held), least);
    // In the picture the places are to be in the middle; what is behind the eye is not in it.
    const before = seen.filter(([, , z]) => distance + z > 0.1 * distance);
    const middle = (of: 0 | 1) => {
      const [low, high] = spread(before.map((p) => p[of] / (distance + p[2])));
      return 0.5 * (low + high) * distance;
    };
    target = add(target, add(scale(right, middle(0)), scale(up, middle(1))));
  }
  return { ...orbit, target, distance };
}

/**
 * The first view of what cameras measured; null: they measured too little.
 * @param pose  of the first camera, 3 x 4, row by row
 * @param isUpright  z is known to be up of a thing that is nobody's view
 */
export function firstView(
  surfaces: readonly SeenSurface[],
  pose: ArrayLike<number>,
  room: Room,
  isUpright = false,
): Orbit | null {
  const isThing = surfaces.some(isNobodysView);
  const places = surfaces.flatMap((seen) => (isThing ? seen.places(PLACES) : nearPlaces(seen)));
  if (places.length < 3) return null;
  const sides = ([0, 1, 2] as const).map((i) => spread(places.map((place) => place[i])));
  const target = sides.map(([low, high]) => 0.5 * (low + high)) as unknown as Vec3;
  const from: Vec3 = [pose[3]!, pose[7]!, pose[11]!];
  if (isThing) {
    // From a corner, its flat side down.
    const [x, y, z] = sides.map(([low, high]) => high - low) as [number, number, number];
    const isLevel = isUpright || z <= Math.max(x, y);
    const back: Vec3 = isLevel ? [0.6, -0.9, 0.7] : [0.6, 0.5, 1];
    const up: Vec3 = isLevel ? [0, 0, 1] : [0, 1, 0];
    return framed(lookAt(add(target, back), target, up), places, room, HELD_OF_THINGS);
  }
  const facets = surfaces.flatMap(facetsOf);
  const hint = upFromPose(pose);
  const ground = largestPlane(facets, (normal) => dot(normal, hint) > LEVEL);
  const isOwnFrame = hint[1] === -1; // the world is the camera's own frame and knows no up
  const up = isOwnFrame && ground ? ground : hint;
  const towards = unit(sub(from, target));
  const plane = ground ?? largestPlane(facets);
  const back = plane ? above(towards, plane) : towards;
  return framed(turned(lookAt(add(target, back), target, up), ASIDE, 0), places, room);
}

function nearPlaces(seen: SeenSurface): Vec3[] {
  const places = seen.places(PLACES);
  if (places.length === 0) return [];
  const distances = places.map((place) => length(sub(place, seen.eye)));
  const farthest = NEAR * quantile(distances, 0.25);
  return places.filter((_, i) => distances[i]! <= farthest);
}

// Points on all sides of where their camera should be: a mesh, or a scanner that turns.
function isNobodysView(seen: SeenSurface): boolean {
  if (!seen.unordered) return false;
  const places = seen.places(PLACES);
  const behind = places.filter((place) => dot(sub(place, seen.eye), seen.forward) <= 0);
  return behind.length > 0.02 * places.length;
}

// A direction to look from, raised to see a plane not too flatly.
function above(towards: Vec3, normal: Vec3): Vec3 {
  const height = clamp(dot(towards, normal), -1, 1);
  if (height > Math.sin(FLATTEST)) return towards;
  const along = unit(sub(towards, scale(normal, height)));
  return add(scale(along, Math.cos(FLATTEST)), scale(normal, Math.sin(FLATTEST)));
}

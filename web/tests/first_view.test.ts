// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import { axes, dot, eye, length, metresPerPixel, sub, type Orbit } from "../src/camera_math";
import { firstView, largestPlane, offCentre, type Room } from "../src/first_view";
import type { Frame, Vec3 } from "../src/protocol";
import { SeenSurface } from "../src/surface";
import { asPoints, block, both, normalNumbers, plane, seen } from "./scene";

// The panel leaves the left of the window.
const ROOM: Room = { width: 1280, height: 800, left: 0, top: 50, right: 940, bottom: 800 };

const TABLE = both(plane([0, 0, 0], [0, 0, 1]), block([-0.1, 0.1, 0], [0.1, 0.3, 0.2]));
const noise = normalNumbers(3);
const views = {
  "a table from above": seen(TABLE, [0, -0.5, 0.9], [0, 0.1, 0]),
  "a table nearly edge-on": seen(TABLE, [0, -1, 0.25], [0, 0.1, 0], () => 0.002 * noise()),
  "a table far away": seen(TABLE, [0, -4, 3], [0, 0.1, 0]),
};

/** Where a place is drawn [px]. */
function pixel(orbit: Orbit, room: Room, place: Vec3): [number, number] {
  const { right, up, forward } = axes(orbit);
  const away = sub(place, eye(orbit));
  const size = metresPerPixel(dot(away, forward), room.height);
  const off = offCentre(room);
  return [
    0.5 * room.width + off.x + dot(away, right) / size,
    0.5 * room.height + off.y - dot(away, up) / size,
  ];
}

function shareWithin(orbit: Orbit, room: Room, places: readonly Vec3[]): number {
  const inside = places.filter((place) => {
    const [x, y] = pixel(orbit, room, place);
    return x >= room.left && x <= room.right && y >= room.top && y <= room.bottom;
  });
  return inside.length / places.length;
}

describe.each(Object.entries(views))("%s", (_, frame) => {
  const surface = new SeenSurface(frame, null);
  const view = firstView([surface], frame.worldFromCamera, ROOM)!;

  test("lies in the free part of the window and fills it", () => {
    const near = surface.places(3000).filter((place) => length(sub(place, surface.eye)) < 6);
    expect(shareWithin(view, ROOM, near)).toBeGreaterThan(0.85);
    const closer = { ...view, distance: 0.6 * view.distance };
    expect(shareWithin(closer, ROOM, near)).toBeLessThan(0.9);
  });

  test("is looked at from well above the table", () => {
    const height = dot(axes(view).forward, [0, 0, -1]);
    expect(height).toBeGreaterThan(Math.sin((29 * Math.PI) / 180));
    expect(view.up).toEqual([0, 0, 1]);
  });
});

test("a camera that does not know where up is takes it from the table", () => {
  // As a single image comes: the world is the camera's own frame.
  const frame = views["a table from above"];
  const own: Frame = {
    ...frame,
    worldFromCamera: Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]),
  };
  const view = firstView([new SeenSurface(own, null)], own.worldFromCamera, ROOM)!;
  const pose = frame.worldFromCamera;
  const up: Vec3 = [pose[8]!, pose[9]!, pose[10]!]; // the world's z as the camera sees it
  expect(dot(view.up, up)).toBeGreaterThan(Math.cos((3 * Math.PI) / 180));
});

test("a mesh is seen from a corner, whole", () => {
  const points = Float32Array.from(
    [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1].flatMap((z) => [x, y, 0.5 * z]))),
  );
  const frame: Frame = {
    ...asPoints(views["a table far away"]),
    worldFromCamera: Float32Array.from([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]),
    width: 8,
    points,
  };
  const surface = new SeenSurface(frame, null);
  const view = firstView([surface], frame.worldFromCamera, ROOM)!;
  expect(shareWithin(view, ROOM, surface.places(100))).toBe(1);
  expect(view.up).toEqual([0, 0, 1]);
  for (const away of sub(eye(view), view.target)) expect(Math.abs(away)).toBeGreaterThan(0.2);
});

test("the largest plane is that of the most area, and none among normals of all directions", () => {
  const facets = [
    ...Array.from({ length: 30 }, () => ({ normal: [0, 0, 1] as Vec3, area: 1 })),
    ...Array.from({ length: 3 }, () => ({ normal: [1, 0, 0] as Vec3, area: 20 })),
  ];
  expect(largestPlane(facets)).toEqual([1, 0, 0]);
  expect(largestPlane(facets, (normal) => normal[2] > 0.5)).toEqual([0, 0, 1]);
  const random = normalNumbers(7);
  const ball = Array.from({ length: 300 }, () => {
    const way: Vec3 = [random(), random(), random()];
    return { normal: way.map((x) => x / length(way)) as unknown as Vec3, area: 1 };
  });
  expect(largestPlane(ball)).toBeNull();
});

// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import { dot, length, scale, sub, unit } from "../src/camera_math";
import type { Rays, Vec3 } from "../src/protocol";
import { fitPlane, onPlane, SeenSurface } from "../src/surface";
import { asMesh, asPoints, block, both, HEIGHT, normalNumbers, plane, seen, WIDTH } from "./scene";

const DESK = plane([0, 0, 0], [0, 0, 1]);
const BOX_LOW: Vec3 = [-0.05, 0.05, 0];
const BOX_HIGH: Vec3 = [0.05, 0.15, 0.1];
const SCENE = both(DESK, block(BOX_LOW, BOX_HIGH));
const CAMERA: Vec3 = [0, -0.5, 0.6];
const degrees = (a: Vec3, b: Vec3) =>
  (180 / Math.PI) * Math.acos(Math.min(1, dot(unit(a), unit(b))));

const image = new SeenSurface(seen(SCENE, CAMERA, [0, 0.05, 0]), null);
const points = new SeenSurface(asPoints(seen(SCENE, CAMERA, [0, 0.05, 0])), null);

describe.each([
  ["a depth image", image],
  ["points without an image", points],
])("%s", (_, surface) => {
  test.each<[string, Vec3, Vec3, Vec3]>([
    ["the desk", [0.1, -0.4, 0.4], [-0.1, -0.05, 0], [0, 0, 1]],
    ["the box from above", [0.1, -0.2, 0.5], [0.01, 0.11, 0.1], [0, 0, 1]],
    ["the box's front", [0.1, -0.6, 0.4], [0.01, 0.05, 0.06], [0, -1, 0]],
  ])("is met by a ray to %s", (_, from, wanted, normal) => {
    const met = surface.meet(from, unit(sub(wanted, from)))!;
    expect(length(sub(met.spot.at, wanted))).toBeLessThan(0.004);
    expect(degrees(met.spot.normal, normal)).toBeLessThan(8);
    expect(met.distance).toBeCloseTo(length(sub(wanted, from)), 1);
  });

  test("is not met by a ray that looks past it", () => {
    expect(surface.meet([0, -0.4, 0.4], unit([0, -0.3, 0.1]))).toBeNull();
  });
});

test("a ray through what the camera did not see meets no surface there", () => {
  // From aside, low behind the box: the shadow of the box on the desk, seen by nobody.
  const from: Vec3 = [0.4, 0.2, 0.3];
  const hidden: Vec3 = [0, 0.18, 0];
  expect(image.meet(from, unit(sub(hidden, from)))).toBeNull();
});

test("a normal averages the noise of many pixels", () => {
  const noise = normalNumbers(7);
  const noisy = new SeenSurface(
    seen(DESK, CAMERA, [0, 0, 0], () => 0.002 * noise()),
    null,
  );
  let worst = 0;
  for (let x = -0.1; x <= 0.1; x += 0.02) {
    const from: Vec3 = [0.2, -0.4, 0.5];
    const met = noisy.meet(from, unit(sub([x, 0, 0], from)))!;
    expect(Math.abs(met.spot.at[2])).toBeLessThan(0.004); // 2 mm of noise a pixel
    worst = Math.max(worst, degrees(met.spot.normal, [0, 0, 1]));
  }
  expect(worst).toBeLessThan(25);
});

test("what is measured on the sightline through a point lies on the surface", () => {
  const at = image.onSightline([0.1, 0, 0.1])!;
  expect(Math.abs(at[2])).toBeLessThan(0.003);
  // Camera, point and place are in a line, to a pixel.
  expect(degrees(sub(at, CAMERA), sub([0.1, 0, 0.1], CAMERA))).toBeLessThan(0.5);
  expect(image.onSightline([0, -2, 0.6])).toBeNull(); // behind the camera's back
});

test("a lens that bends rays is followed", () => {
  const frame = { ...seen(DESK, [0, 0, 0.5], [0, 0, 0]), hasRays: true };
  // Each pixel looks 10 % farther out than a lens without distortion would at its corner.
  const [fx, , cx, cy] = frame.intrinsics;
  const rays = new Float32Array(2 * WIDTH * HEIGHT);
  const bent = (r: number) => 1 + 0.25 * r * r;
  for (let v = 0; v < HEIGHT; ++v) {
    for (let u = 0; u < WIDTH; ++u) {
      const [x, y] = [(u - cx) / fx, (v - cy) / fx];
      const k = bent(Math.hypot(x, y));
      rays.set([x * k, y * k], 2 * (v * WIDTH + u));
    }
  }
  frame.depth!.fill(5000);
  const message: Rays = { kind: "rays", camera: 0, width: WIDTH, height: HEIGHT, rays };
  const lens = new SeenSurface(frame, message);
  const from: Vec3 = [0.05, 0.02, 0.3];
  const met = lens.meet(from, unit(sub([0.18, 0.1, 0], from)))!;
  expect(length(sub(met.spot.at, [0.18, 0.1, 0]))).toBeLessThan(0.002);
  // Without its rays nothing can be said of such an image.
  expect(new SeenSurface(frame, null).meet(from, [0, 0, -1])).toBeNull();
});

test("a plane is fitted exactly to points of a plane", () => {
  const normal = unit([0.3, -0.2, 1]);
  const places: Vec3[] = [];
  for (let x = -2; x <= 2; ++x)
    for (let y = -2; y <= 2; ++y)
      places.push([x / 100, y / 100, -(normal[0] * x + normal[1] * y) / 100 / normal[2]]);
  const spot = fitPlane(places, [0.001, 0.002, 0.003], [0, 0, 1]);
  expect(degrees(spot.normal, normal)).toBeLessThan(1e-4);
  expect(dot(spot.at, normal)).toBeCloseTo(0, 12);
  // Points in a line tell no plane.
  const line = places.map(([x]): Vec3 => [x, 0, 0]);
  expect(fitPlane(line, [0, 0, 0], [0, 0, 1]).normal).toEqual([0, 0, 1]);
  expect(fitPlane([], [0, 0, 0], [0, 1, 0])).toEqual({ at: [0, 0, 0], normal: [0, 1, 0] });
});

describe("a mesh", () => {
  const view = seen(DESK, CAMERA, [0, 0.05, 0]);
  // No corner within a metre of the middle.
  const square = (z: number): Vec3[] => [
    [-1, -1, z],
    [1, -1, z],
    [1, 1, z],
    [-1, 1, z],
  ];
  const halves = [0, 1, 2, 0, 2, 3];
  const sheet = new SeenSurface(asMesh(view, square(0), halves), null);

  test("is met far from its corners, where the ray meets the face", () => {
    const from: Vec3 = [0.1, -0.3, 0.4];
    // On both halves, and where they meet.
    for (const wanted of [[0.5, 0.1, 0], [0.1, 0.5, 0], [0.3, 0.3, 0]] as Vec3[]) {
      const met = sheet.meet(from, unit(sub(wanted, from)))!;
      expect(length(sub(met.spot.at, wanted))).toBeLessThan(1e-5);
      expect(degrees(met.spot.normal, [0, 0, 1])).toBeLessThan(0.01);
      expect(met.distance).toBeCloseTo(length(sub(wanted, from)), 5);
    }
    expect(sheet.meet(from, unit(sub([1.2, 0, 0], from)))).toBeNull();
    expect(sheet.meet(from, [0, 0, 1])).toBeNull();
  });

  test("is met from its back, too, and faces whoever looks", () => {
    const met = sheet.meet([0.2, 0.1, -0.5], [0, 0, 1])!;
    expect(length(sub(met.spot.at, [0.2, 0.1, 0]))).toBeLessThan(1e-5);
    expect(degrees(met.spot.normal, [0, 0, -1])).toBeLessThan(0.01);
  });

  test("is met where it is nearest, whatever the order of its faces", () => {
    const corners = [...square(0), ...square(0.2), ...square(-0.2)];
    for (const first of [0, 4, 8]) {
      const order = [0, 4, 8].map((k) => (k + first) % 12);
      const faces = order.flatMap((k) => halves.map((i) => i + k));
      const layers = new SeenSurface(asMesh(view, corners, faces), null);
      expect(layers.meet([0.1, 0.3, 0.6], [0, 0, -1])!.spot.at[2]).toBeCloseTo(0.2, 5);
    }
  });

  test("of small faces has the normal of the surface that they approximate", () => {
    const [radius, columns, rows] = [0.05, 40, 20];
    const corners: Vec3[] = [];
    const faces: number[] = [];
    const noise = normalNumbers(11);
    for (let v = 0; v <= rows; ++v)
      for (let u = 0; u < columns; ++u) {
        const [a, b] = [(2 * Math.PI * u) / columns, (Math.PI * v) / rows];
        const r = radius + 0.0003 * noise();
        corners.push(
          scale([Math.sin(b) * Math.cos(a), Math.sin(b) * Math.sin(a), Math.cos(b)], r),
        );
        if (v === rows) continue;
        const [at, right] = [columns * v + u, columns * v + ((u + 1) % columns)];
        faces.push(at, at + columns, right, right, at + columns, right + columns);
      }
    const ball = new SeenSurface(asMesh(view, corners, faces), null);
    for (let i = 0; i < 100; ++i) {
      const out = unit([noise(), noise(), 0.3 * noise()]);
      const { spot } = ball.meet(scale(out, 0.4), scale(out, -1))!;
      expect(Math.abs(length(spot.at) - radius)).toBeLessThan(0.0015);
      expect(degrees(spot.normal, out)).toBeLessThan(8);
    }
  });

  test("has points that no face joins", () => {
    const faces = [0, 1, 2];
    const loose: Vec3 = [0.1, 0.2, 0.3];
    const sparse = new SeenSurface(asMesh(view, [...square(0), loose], faces), null);
    const from: Vec3 = [0.5, -0.2, 0.5]; // and past the face
    expect(sparse.meet(from, unit(sub(loose, from)))!.distance).toBeCloseTo(
      length(sub(loose, from)),
      2,
    );
  });
});

test("a ray meets a plane before it and no other", () => {
  const spot = { at: [0, 0, 1] as Vec3, normal: [0, 0, 1] as Vec3 };
  const met = onPlane([0, 0, 2], unit([1, 0, -1]), spot)!;
  expect(length(sub(met, [1, 0, 1]))).toBeLessThan(1e-12);
  expect(onPlane([0, 0, 2], [1, 0, 0], spot)).toBeNull();
  expect(onPlane([0, 0, 0], [0, 0, -1], spot)).toBeNull();
});

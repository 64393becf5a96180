// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import type { Vec3 } from "../src/protocol";
import { canRescale, timesOf } from "../src/ruler";
import { solidPlaces } from "../src/splat";
import { ball } from "./splats";

test("a pointer meets what hides what is behind it, about its middle", () => {
  const solid = ball(500, 0.1).map(({ mean }) => [...mean, 0, ...Array(6).fill(1e-6), 0.99, 0]);
  const fog = [9, 9, 9, 0, ...Array(6).fill(1e-6), 0.2, 0];
  const frame = solidPlaces(Float32Array.from([...solid, fog].flat()));
  expect(frame.width).toBe(500);
  for (const i of [3, 7, 11]) expect(frame.worldFromCamera[i]).toBeCloseTo(0, 3);
  expect(Math.hypot(...frame.points!.subarray(0, 3))).toBeCloseTo(0.1, 3);
});

test("two places and their distance give the scale", () => {
  const places: Vec3[] = [
    [0, 0, 1],
    [0, 0.5, 1],
  ];
  expect(timesOf(places, 0.05)).toBeCloseTo(0.1, 12);
  expect(timesOf(places.slice(1), 0.05)).toBeNull();
  expect(timesOf([places[0]!, places[0]!], 0.05)).toBeNull();
  expect(timesOf(places, NaN)).toBeNull();
  expect(timesOf(places, -1)).toBeNull();
  const of = (uri: string) => ({ role: "operating", cameras: [{ uri }] }) as any;
  expect(canRescale(of("splat:cup.ply"))).toBe(true);
  expect(canRescale(of("synthetic:desk"))).toBe(false);
  expect(canRescale({ ...of("map:cup.stl"), role: "holding" })).toBe(false);
});

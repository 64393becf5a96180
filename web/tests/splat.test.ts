// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import type { Vec3 } from "../src/protocol";
import { canRescale, timesOf } from "../src/ruler";
import { solidPlaces } from "../src/splat";
import { readSplat } from "../src/splat_file";
import { ball, glbOf, plyOf, spzOf, type Made } from "./splats";

const HERE = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
const tilted: Made = {
  mean: [0.25, -0.5, 1.125],
  sigma: [Math.exp(-3), Math.exp(-4), Math.exp(-6)], // which SPZ can say
  turn: [Math.SQRT1_2, 0, 0, Math.SQRT1_2], // y to z
  colour: [0.8, 0.5, 0.2],
  opacity: 0.8,
};
const read = async (name: string, bytes: Buffer, pose = HERE) =>
  readSplat(name, Uint8Array.from(bytes).buffer, pose);

describe("a splat's file", () => {
  const files: [string, Buffer][] = [
    ["a.ply", plyOf([tilted])],
    ["a.SPZ", spzOf([tilted])],
    ["a4.spz", spzOf([tilted], 4)],
    ["a.glb", glbOf([{ ...tilted, mean: [0.25, -0.5, 0.125] }], [0, 0, 1])],
  ];
  test.each(files)("%s gives its Gaussian's place, shape and colour", async (name, bytes) => {
    const { count, means, covariances, colours } = await read(name, bytes);
    expect(count).toBe(1);
    tilted.mean.forEach((x, k) => expect(means[k]).toBeCloseTo(x, 6));
    const [a, b, c] = tilted.sigma.map((s) => s * s);
    // The turn takes its second axis to z, and its third to -y.
    [a, 0, 0, c, 0, b].forEach((x, k) => expect(covariances[k]).toBeCloseTo(x!, 6));
    [204, 128, 51, 204].forEach((x, k) => expect(Math.abs(colours[k]! - x)).toBeLessThan(3));
  });

  test("is placed by the pose, with its scale", async () => {
    const pose = [0, -2, 0, 5, 2, 0, 0, 6, 0, 0, 2, 7]; // twice as large, x to y, then moved
    const { means, covariances } = await read("a.ply", plyOf([tilted]), pose);
    [5 + 1, 6 + 0.5, 7 + 2.25].forEach((x, k) => expect(means[k]).toBeCloseTo(x, 6));
    const [a, b, c] = tilted.sigma.map((s) => 4 * s * s);
    [c, 0, 0, a, 0, b].forEach((x, k) => expect(covariances[k]).toBeCloseTo(x!, 6));
  });

  test("of another kind is named", async () => {
    await expect(read("a.gltf", Buffer.from("{}"))).rejects.toThrow(".gltf");
  });

  test("gives a pointer what hides what is behind it, about its middle", async () => {
    const fog = { ...tilted, mean: [9, 9, 9] as Vec3, opacity: 0.2 };
    const frame = solidPlaces(await read("a.ply", plyOf([...ball(500, 0.1), fog])));
    expect(frame.width).toBe(500);
    for (const i of [3, 7, 11]) expect(frame.worldFromCamera[i]).toBeCloseTo(0, 3);
    expect(Math.hypot(...frame.points!.subarray(0, 3))).toBeCloseTo(0.1, 3);
  });
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

// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import type { CameraState } from "../src/protocol";
import { handAt, longest, timeText, trailAt } from "../src/timeline";

test("times are minutes and seconds", () => {
  expect(timeText(0)).toBe("0:00.0");
  expect(timeText(9.96)).toBe("0:10.0");
  expect(timeText(59.97)).toBe("1:00.0");
  expect(timeText(754.32)).toBe("12:34.3");
});

test("the timeline is of the longest recording, and of no live camera or still picture", () => {
  const camera = (uri: string, frames: number): CameraState => {
    const live = { kind: "", sensor: "unknown", dropped: 0,
    stays_valid: false, rate: 30, state: "live" };
    return { uri, ...live, frames, place: 0, time: 0 };
  };
  expect(longest([camera("synthetic:desk", 0), camera("pcd:one", 1)])).toBeNull();
  expect(longest([camera("a", 5), camera("b", 90), camera("c", 30)])?.uri).toBe("b");
});

test("a recorded hand is between the places of its path, and nowhere beyond them", () => {
  const places = Float32Array.of(-0.5, 0, 0, 1, 0.5, 0, 1, 1, 1, 2, 1, 1, 4, 2, 1, 1);
  expect(handAt(places, -0.5)).toEqual([0, 0, 1]);
  expect(handAt(places, 0)).toEqual([0, 0.5, 1]);
  expect(handAt(places, 0.75)).toEqual([1, 1, 1]);
  expect(handAt(places, 4)).toEqual([2, 1, 1]);
  expect(handAt(places, -0.51)).toBeNull();
  expect(handAt(places, 4.01)).toBeNull();
  expect(handAt(Float32Array.of(0, 1, 2, 3), 0)).toBeNull();
  expect(trailAt(places, 0.75, 0.5, 2)).toEqual([0, 0.75, 1, 0, 1, 1, 1, 1, 1]);
});

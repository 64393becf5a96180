// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { asked } from "../src/worker_connection";

test("an address names a scene with its options, or a file", () => {
  expect(asked("")).toEqual({ scene: "synthetic:desk", file: null });
  expect(asked("?scene=sphere&material=wood&size=320x240")).toEqual({
    scene: "synthetic:sphere?material=wood&size=320x240",
    file: null,
  });
  const file = "https://host/cup.ply";
  expect(asked(`?file=${encodeURIComponent(file)}`)).toEqual({ scene: "synthetic:desk", file });
});

// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { asked } from "../src/worker_connection";

test("an address names a scene with its options, or a file", () => {
  const inverse3 = "ws://localhost:10001";
  expect(asked("")).toEqual({ scene: "synthetic:desk", file: null, inverse3 });
  expect(asked("?scene=sphere&material=wood&size=320x240&view=1,2&t=3")).toEqual({
    scene: "synthetic:sphere?material=wood&size=320x240",
    file: null,
    inverse3,
  });
  const file = "https://host/cup.ply";
  expect(asked(`?file=${encodeURIComponent(file)}`)).toMatchObject({
    scene: "synthetic:desk",
    file,
  });
});

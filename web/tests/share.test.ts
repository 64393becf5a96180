// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { lookAt } from "../src/camera_math";
import { linked, linkTo } from "../src/share";

test("a link leads to the view and the frame that it was made at", () => {
  const orbit = lookAt([0.3, -0.4, 0.5], [0.1, 0, 0.02], [0, 0, 1]);
  const link = linkTo("https://host/page?file=cup.ply&token=secret", orbit, 42);
  expect(link).not.toContain("secret");
  const { search } = new URL(link);
  expect(new URLSearchParams(search).get("file")).toBe("cup.ply");
  const there = linked(search);
  expect(there.frame).toBe(42);
  for (const key of ["yaw", "pitch", "distance"] as const)
    expect(there.orbit![key]).toBeCloseTo(orbit[key], 3);
  expect(linked(new URL(linkTo(link, orbit, null)).search).frame).toBeNull();
});

test("a link without a view, or with one from nowhere, asks for none", () => {
  for (const search of ["", "?view=1,2,3", "?view=0,0,0,0,0,0,0,0,1", "?view=a&t=-1", "?t=x"])
    expect(linked(search)).toEqual({ orbit: null, frame: null });
});

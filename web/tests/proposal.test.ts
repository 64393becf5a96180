// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { lengthText, radiusRemark, scaleQuestion } from "../src/proposal";

const elephant = { extent: 47.13, spacing: 0.31, scale: 0.01, rescaled: "ply:e.ply?scale=0.01" };

test("writes lengths as people do", () => {
  expect([0.0082, 0.47, 1, 47.13].map(lengthText)).toEqual(["8.2 mm", "470 mm", "1 m", "47.1 m"]);
});

test("asks once whether a scene is to be touched at another size", () => {
  expect(scaleQuestion(elephant)).toBe(
    "This is 47.1 m long, with points 310 mm apart, too far for any sphere. Touch it as 471 mm?",
  );
  expect(scaleQuestion({ extent: 2e-3, spacing: 1e-4, scale: 100, rescaled: "ply:x" })).toBe(
    "This is 2 mm long, smaller than the sphere. Touch it as 200 mm?",
  );
  expect(scaleQuestion({ ...elephant, rescaled: "" })).toBe("");
  expect(scaleQuestion(null)).toBe("");
});

test("says why the sphere is larger than the usual one", () => {
  expect(radiusRemark({ ...elephant, spacing: 0.008 }, 0.0096, 0.005)).toBe(
    "The points are 8 mm apart, so the sphere is 19.2 mm wide.",
  );
  expect(radiusRemark(elephant, 0.005, 0.005)).toBe("");
  expect(radiusRemark(null, 0.01, 0.005)).toBe("");
});

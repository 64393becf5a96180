// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { refusalText } from "../src/connection";

test("a page that is not let in says why, and where its link is", () => {
  expect(refusalText(401, true)).toMatch(/token.*wrong.*link that the program printed/);
  expect(refusalText(401, false)).toMatch(/lacks its token.*link that the program printed/);
  expect(refusalText(429, true)).toContain("Wait");
  expect(refusalText(503, false)).toContain("Too many pages");
  for (const other of [0, 200, 404, 500]) expect(refusalText(other, true)).toBeNull();
});

// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { plainName, whyNotSent } from "../src/files";
import { sceneName } from "../src/panel";

test("a file is sent under a plain name that keeps its ending", () => {
  expect(plainName("Büro (2).ply")).toBe("B_ro_2_.ply");
  expect(plainName("../.hidden.pcd")).toBe("_.hidden.pcd");
  expect(plainName("x".repeat(300) + ".ply")).toHaveLength(100);
  expect(plainName("x".repeat(300) + ".ply")).toMatch(/\.ply$/);
});

test("what is not sent is said before it is", () => {
  const hello = { file_limit: 1e6 };
  const operator = { role: "operating" } as const;
  const cup = { name: "cup.ply", size: 1e6 };
  expect(whyNotSent([cup], hello, operator)).toBeNull();
  expect(whyNotSent([{ ...cup, size: 1e6 + 1 }], hello, operator)).toContain("cup.ply is of 2 MB");
  expect(whyNotSent([cup, cup], hello, operator)).toContain("one file");
  expect(whyNotSent([cup], { file_limit: 0 }, operator)).toContain("--camera");
  expect(whyNotSent([cup], hello, { role: "holding" })).toContain("operator");
  expect(whyNotSent([cup], null, null)).toContain("connection");
});

test("a scene is called by the last part of its path", () => {
  expect(sceneName("synthetic:desk?noise=1mm")).toBe("desk?noise=1mm");
  expect(sceneName("ply:scans/cup.ply?scale=1mm")).toBe("cup.ply?scale=1mm");
  expect(sceneName("tum:fr1_xyz/")).toBe("fr1_xyz/");
});

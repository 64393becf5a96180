// SPDX-License-Identifier: Apache-2.0
import type { ShaderMaterial } from "three";
import { expect, test } from "vitest";
import { CameraCloud } from "../src/cloud";
import type { Vec3 } from "../src/protocol";
import { MOST_FACES } from "../src/thinning";
import { asMesh, plane, seen } from "./scene";

const view = seen(plane([0, 0, 0], [0, 0, 1]), [0, -0.5, 0.6], [0, 0, 0]);
const corners = Array.from({ length: 6000 }, (_, i): Vec3 => [(i % 100) / 100, i / 6000, 0]);

function drawn(faces: number, stride: number) {
  const cloud = new CameraCloud();
  const triangles = Array.from({ length: Math.min(faces, 10) }, () => [0, 1, 100]).flat();
  const mesh = asMesh(view, corners, triangles);
  // The many are of no size.
  if (faces > 10) mesh.triangles = new Uint32Array(3 * faces);
  cloud.show(mesh);
  cloud.prepare(stride, 1000, 1);
  return {
    faces: cloud.faces.visible,
    points: cloud.object.geometry.drawRange.count,
    spacing: (cloud.object.material as ShaderMaterial).uniforms.pointSpacing!.value.x as number,
  };
}

test("a mesh is drawn by its faces, and by its corners as points beyond a budget", () => {
  for (const stride of [1, 2, 3, 6]) {
    const most = Math.floor(MOST_FACES / stride ** 2);
    const within = drawn(most, stride);
    expect(within.faces).toBe(true);
    expect(within.spacing).toBe(0); // the faces are in between
    const beyond = drawn(most + 1, stride);
    expect(beyond.faces).toBe(false);
    // As large as they are apart: 6000 on a square metre.
    expect(beyond.spacing).toBeGreaterThan(0.005);
    expect(beyond.spacing).toBeLessThan(0.05);
    expect(beyond.points).toBeGreaterThanOrEqual(2000);
    expect(beyond.points).toBeLessThanOrEqual(6000);
  }
});

test("points that no face joins are drawn without faces", () => {
  expect(drawn(0, 1).faces).toBe(false);
});

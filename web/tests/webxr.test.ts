// SPDX-License-Identifier: Apache-2.0
import { expect, test } from "vitest";
import { pinholeOf } from "../src/webxr";

const size = { width: 160, height: 90 };
// 90 degrees across and 60 down, off its middle.
const [across, down, aside, above] = [1, Math.sqrt(3), 0.1, -0.2];
const projectionMatrix = Float32Array.from({ length: 16 });
projectionMatrix.set([across], 0);
projectionMatrix.set([down], 5);
projectionMatrix.set([aside, above], 8);
// One metre up, looking north: along -z in WebXR, along y here.
const transform = { matrix: Float32Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 1) };

/** Where a pixel's place at one metre is [m, world]. */
function placeOf(found: NonNullable<ReturnType<typeof pinholeOf>>, u: number, v: number) {
  const [fx, fy, cx, cy] = found.camera as unknown as [number, number, number, number];
  const local = [(u - cx) / fx, (v - cy) / fy, 1, 1];
  return [0, 1, 2].map((i) => local.reduce((sum, x, j) => sum + found.pose[4 * j + i]! * x, 0));
}

function expectClose(found: number[], wanted: number[]) {
  wanted.forEach((x, i) => expect(found[i]).toBeCloseTo(x, 5));
}

// Of a place in the view, from 0 to 1, the place in the buffer: and its matrix.
const asTheView = (x: number, y: number) => [x, y] as const;
const onItsSide = (x: number, y: number) => [y, 1 - x] as const; // as a phone's, held upright

test.each([
  ["as the view", [1, 0, 0, 1], [0, 0], asTheView],
  ["on its side", [0, -1, 1, 0], [0, 1], onItsSide],
] as const)("a depth buffer that lies %s shows what the view sees", (_, turn, shift, buffer) => {
  const matrix = new Float32Array(16);
  matrix.set([turn[0], turn[1]], 0);
  matrix.set([turn[2], turn[3]], 4);
  matrix.set([...shift, 0, 1], 12);
  const view = { projectionMatrix, transform };
  const found = pinholeOf(view, { ...size, normDepthBufferFromNormView: { matrix } })!;
  for (const [x, y] of [[0.5, 0.5], [0.2, 0.9]] as const) {
    const [s, t] = buffer(x, y);
    const place = placeOf(found, s * size.width - 0.5, t * size.height - 0.5);
    const right = (2 * x - 1 + aside) / across;
    const up = (1 - 2 * y + above) / down;
    expectClose(place, [right, 1, 1 + up]);
  }
});

test("a mirrored depth buffer is no camera", () => {
  const matrix = Float32Array.of(-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1);
  const view = { projectionMatrix, transform };
  expect(pinholeOf(view, { ...size, normDepthBufferFromNormView: { matrix } })).toBeNull();
});

// SPDX-License-Identifier: Apache-2.0
import { describe, expect, test } from "vitest";
import {
  decode,
  encodeHand,
  encodeShown,
  Grip,
  type Frame,
  type HandPath,
  type Rays,
  type Ticks,
  type Tool,
} from "../src/protocol";

function frameMessage(
  format: number,
  payload: ArrayBuffer,
  width: number,
  height: number,
): ArrayBuffer {
  const bytes = new Uint8Array(96 + payload.byteLength);
  const view = new DataView(bytes.buffer);
  view.setUint8(0, 1);
  view.setUint8(1, 2);
  view.setUint8(2, format);
  view.setUint32(4, 41, true);
  view.setFloat64(8, 12.5, true);
  view.setUint32(16, width, true);
  view.setUint32(20, height, true);
  [525, 526, 319.5, 239.5].forEach((value, i) => view.setFloat32(24 + 4 * i, value, true));
  view.setFloat32(40, 0.001, true);
  for (let i = 0; i < 12; ++i) view.setFloat32(44 + 4 * i, i, true);
  bytes.set(new Uint8Array(payload), 96);
  return bytes.buffer;
}

function ticksMessage(samples: number[][], contacts: number[][] = []): ArrayBuffer {
  const behind = 160 + 24 * contacts.length;
  const buffer = new ArrayBuffer(behind + 28 * samples.length);
  const view = new DataView(buffer);
  view.setUint8(0, 2);
  view.setUint8(1, 1);
  view.setUint16(2, samples.length, true);
  view.setUint32(4, 0x80000001, true);
  view.setFloat64(8, 100, true);
  view.setUint32(16, 64, true);
  view.setUint32(20, 7, true);
  for (let i = 0; i < 12; ++i) view.setFloat32(24 + 4 * i, i + 1, true);
  view.setFloat32(72, 0.25, true);
  view.setInt32(76, -1, true);
  view.setFloat32(80, 0.5, true);
  view.setFloat32(84, 12, true);
  [13, 14, 15, 2, 0.5].forEach((value, i) => view.setFloat32(88 + 4 * i, value, true));
  view.setUint32(108, 5, true);
  for (let i = 0; i < 11; ++i) view.setFloat32(112 + 4 * i, 20 + i, true);
  view.setUint32(156, contacts.length, true);
  [...contacts, ...samples].flat().forEach((value, i) => view.setFloat32(160 + 4 * i, value, true));
  return buffer;
}

test("a recorded hand's path keeps its four numbers a place", () => {
  const buffer = new ArrayBuffer(8 + 32);
  const view = new DataView(buffer);
  view.setUint8(0, 4);
  view.setUint8(1, 3);
  view.setUint32(4, 2, true);
  new Float32Array(buffer, 8).set([0, 1, 2, 3, 0.5, 4, 5, 6]);
  expect(decode(buffer)).toMatchObject({ kind: "path", camera: 3 });
  expect([...(decode(buffer) as HandPath).places]).toEqual([0, 1, 2, 3, 0.5, 4, 5, 6]);
  expect(() => decode(buffer.slice(0, 24))).toThrow("cut short");
});

test("a tool is its points and their triangles", () => {
  const buffer = new ArrayBuffer(12 + 36 + 12);
  const view = new DataView(buffer);
  view.setUint8(0, 5);
  [3, 1].forEach((count, i) => view.setUint32(4 + 4 * i, count, true));
  new Float32Array(buffer, 12, 9).set([0, 0, 0, 1, 0, 0, 0, 1, 0]);
  new Uint32Array(buffer, 48).set([2, 0, 1]);
  const { points, triangles } = decode(buffer) as Tool;
  expect([...points]).toEqual([0, 0, 0, 1, 0, 0, 0, 1, 0]);
  expect([...triangles]).toEqual([2, 0, 1]);
  expect(() => decode(buffer.slice(0, 56))).toThrow("cut short");
  view.setUint32(4, 0, true);
  view.setUint32(8, 0, true);
  expect((decode(buffer.slice(0, 12)) as Tool).triangles).toHaveLength(0); // a ball
});

describe("a frame", () => {
  test("has the faces of a mesh behind its corners", () => {
    const payload = new ArrayBuffer(3 * 12 + 12);
    new Float32Array(payload, 0, 9).set([0, 0, 0, 1, 0, 0, 0, 1, 0]);
    new Uint32Array(payload, 36).set([2, 0, 1]);
    const message = frameMessage(2, payload, 3, 1);
    expect(() => decode(message)).toThrow("cut short");
    new DataView(message).setUint32(92, 1, true);
    const frame = decode(message) as Frame;
    expect(frame.points).toHaveLength(9);
    expect([...frame.triangles!]).toEqual([2, 0, 1]);
  });
  test("keeps the depths where they lie", () => {
    const message = frameMessage(0, new Uint16Array([0, 700, 65535, 1, 2, 3]).buffer, 3, 2);
    const frame = decode(message) as Frame;
    expect(frame).toMatchObject({ camera: 2, number: 41, stamp: 12.5, width: 3, height: 2 });
    expect(frame.intrinsics).toEqual([525, 526, 319.5, 239.5]);
    expect(frame.metresPerUnit).toBeCloseTo(0.001);
    expect([...frame.worldFromCamera]).toEqual([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
    expect([...frame.depth!]).toEqual([0, 700, 65535, 1, 2, 3]);
    expect(frame.depth!.buffer).toBe(message);
    expect(frame.points).toBeNull();
    expect(frame.hasRays).toBe(false);
  });

  test("can be points", () => {
    const frame = decode(
      frameMessage(2, new Float32Array([1, 2, 3, 4, 5, 6]).buffer, 2, 1),
    ) as Frame;
    expect([...frame.points!]).toEqual([1, 2, 3, 4, 5, 6]);
    expect(frame.depth).toBeNull();
  });

  test("has colours of its own pixels, or of another camera", () => {
    const rgb = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18];
    const payload = new Uint8Array(12 + 18);
    payload.set(rgb, 12);
    const message = frameMessage(0, payload.buffer, 3, 2);
    expect(() => decode(message)).toThrow("cut short");
    new DataView(message).setUint8(3, 1);
    expect((decode(message) as Frame).colour).toMatchObject({ width: 3, height: 2, camera: null });
    expect([...(decode(message) as Frame).colour!.rgb]).toEqual(rgb);
    const other = new Uint8Array(72 + 12 + 6);
    other.set([7, 8, 9, 10, 11, 12], 72 + 12);
    const own = frameMessage(0, other.buffer, 3, 2);
    const view = new DataView(own);
    view.setUint8(3, 2);
    [2, 1].forEach((value, i) => view.setUint32(96 + 4 * i, value, true));
    for (let i = 0; i < 16; ++i) view.setFloat32(104 + 4 * i, i, true);
    const { depth, colour } = decode(own) as Frame;
    expect(depth).toHaveLength(6);
    expect([...colour!.rgb]).toEqual([7, 8, 9, 10, 11, 12]);
    expect(colour!.camera!.intrinsics).toEqual([0, 1, 2, 3]);
    expect([...colour!.camera!.cameraFromWorld].slice(0, 2)).toEqual([4, 5]);
  });

  test("is refused when it is cut short or its format is not known", () => {
    expect(() => decode(frameMessage(0, new ArrayBuffer(11), 3, 2))).toThrow("cut short");
    const whole = frameMessage(0, new ArrayBuffer(12), 3, 2);
    expect(() => decode(whole.slice(0, 60))).toThrow("cut short");
    expect(() => decode(frameMessage(3, new ArrayBuffer(12), 3, 2))).toThrow("format 3");
  });
});

describe("ticks", () => {
  test("carry the newest tick and samples with their times", () => {
    const ticks = decode(
      ticksMessage([
        [0.01, 1, 2, 3, 4, 5, 6],
        [0, 5, 6, 7, 8, 9, 10],
      ]),
    ) as Ticks;
    expect(ticks).toMatchObject({ state: 1, flags: 0x80000001, safety: 64, steps: 7, t: 100 });
    expect(ticks.hip).toEqual([1, 2, 3]);
    expect(ticks.force).toEqual([10, 11, 12]);
    expect(ticks.frame).toBe(-1);
    expect(ticks.orientation).toEqual([20, 21, 22, 23]);
    expect(ticks.proxyOrientation).toEqual([24, 25, 26, 27]);
    expect(ticks.torque).toEqual([28, 29, 30]);
    expect(ticks).toMatchObject({ gain: 0.5, askedForce: 12, place: [13, 14, 15] });
    expect(ticks).toMatchObject({ region: 2, guidance: 0.5, fixtures: 5 });
    expect(ticks.samples[0]!.t).toBeCloseTo(99.99);
    expect(ticks.samples[1]).toEqual({
      ...{ t: 100, force: 5, penetration: 6, steps: 7, tickTime: 8 },
      ...{ relative: 9, absolute: 10 },
    });
  });

  test("carry where a tool is held between both", () => {
    const samples = [[0, 5, 6, 7, 8, 9, 10]];
    const message = ticksMessage(samples, [
      [1, 2, 3, 0, 0, 4],
      [5, 6, 7, 0, 2, 0],
    ]);
    const ticks = decode(message) as Ticks;
    expect(ticks.contacts).toEqual([
      { at: [1, 2, 3], push: [0, 0, 4] },
      { at: [5, 6, 7], push: [0, 2, 0] },
    ]);
    expect(ticks.samples).toMatchObject([{ t: 100, force: 5, absolute: 10 }]);
    expect((decode(ticksMessage(samples)) as Ticks).contacts).toHaveLength(0); // a ball
    new DataView(message).setUint32(156, 0xffffffff, true);
    expect(() => decode(message)).toThrow("cut short");
  });

  test("are refused when they are cut short", () => {
    expect(() => decode(ticksMessage([[1, 2, 3, 4, 5, 6, 7]]).slice(0, 164))).toThrow("cut short");
  });
});

test("rays come as pairs for each pixel", () => {
  const buffer = new ArrayBuffer(12 + 16);
  const view = new DataView(buffer);
  view.setUint8(0, 3);
  view.setUint32(4, 2, true);
  view.setUint32(8, 1, true);
  view.setFloat32(24, 0.5, true);
  const rays = decode(buffer) as Rays;
  expect([rays.width, rays.height]).toEqual([2, 1]);
  expect([...rays.rays]).toEqual([0, 0, 0, 0.5]);
});

test("what is not known is refused", () => {
  expect(() => decode(new ArrayBuffer(0))).toThrow("empty");
  expect(() => decode(new Uint8Array([99]).buffer)).toThrow("kind 99");
});

test("a hand is 32 bytes: grip and where", () => {
  const view = new DataView(encodeHand(Grip.held, [0.1, -0.2, 0.3]));
  expect(view.byteLength).toBe(32);
  expect([view.getUint8(0), view.getUint8(1)]).toEqual([16, 1]);
  expect([8, 16, 24].map((at) => view.getFloat64(at, true))).toEqual([0.1, -0.2, 0.3]);
  expect(new DataView(encodeHand(Grip.letGo, [0, 0, 0])).getUint8(1)).toBe(0);
  expect(new DataView(encodeHand(Grip.letGoTowards, [0, 0, 0])).getUint8(1)).toBe(2);
});

test("a frame shown is 8 bytes: camera and number", () => {
  const view = new DataView(encodeShown(3, 4_000_000_000));
  expect(view.byteLength).toBe(8);
  expect([view.getUint8(0), view.getUint8(1), view.getUint32(4, true)]).toEqual([17, 3, 4e9]);
});

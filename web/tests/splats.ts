// SPDX-License-Identifier: Apache-2.0
// Splats whose Gaussians are known, as files of each kind, for tests.

import { gzipSync } from "node:zlib";
import type { Vec3 } from "../src/protocol";

export interface Made {
  mean: Vec3;
  sigma: Vec3;
  /** x y z w */
  turn: [number, number, number, number];
  /** red, green, blue, 0 to 1 */
  colour: Vec3;
  opacity: number;
}

const HARMONIC = 0.5 * Math.sqrt(1 / Math.PI);
const harmonics = ({ colour }: Made) => colour.map((c) => (c - 0.5) / HARMONIC);

/** A ball about the origin, covered with flat Gaussians, in the colours of their directions. */
export function ball(count: number, radius: number): Made[] {
  const apart = radius * Math.sqrt((4 * Math.PI) / count);
  return Array.from({ length: count }, (_, i) => {
    const z = 1 - (2 * (i + 0.5)) / count;
    const [about, wide] = [2.399963 * i, Math.sqrt(1 - z * z)];
    const [x, y] = [wide * Math.cos(about), wide * Math.sin(about)];
    const one = 1 / Math.hypot(1 + z, y, x); // the turn of z into (x, y, z)
    return {
      mean: [radius * x, radius * y, radius * z],
      sigma: [0.6 * apart, 0.6 * apart, 0.05 * apart],
      turn: [-y * one, x * one, 0, (1 + z) * one],
      colour: [0.5 + 0.45 * x, 0.5 + 0.45 * y, 0.5 + 0.45 * z],
      opacity: 0.99,
    };
  });
}

export function plyOf(all: readonly Made[]): Buffer {
  const names =
    "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(" ");
  const header = [
    ...["ply", "format binary_little_endian 1.0", `element vertex ${all.length}`],
    ...[...names.map((name) => `property float ${name}`), "end_header", ""],
  ].join("\n");
  const rows = all.flatMap((one) => {
    const { mean, sigma, turn, opacity } = one;
    const [x, y, z, w] = turn;
    const logit = Math.log(opacity / (1 - opacity));
    return [...mean, ...harmonics(one), logit, ...sigma.map(Math.log), w, x, y, z];
  });
  return Buffer.concat([Buffer.from(header), Buffer.from(Float32Array.from(rows).buffer)]);
}

/** Version 3, with coordinates in steps of 2^-12. */
export function spzOf(all: readonly Made[]): Buffer {
  const header = Buffer.alloc(16);
  [0x5053474e, 3, all.length].forEach((value, i) => header.writeUInt32LE(value, 4 * i));
  header.writeUInt8(12, 13);
  const places = Buffer.alloc(9 * all.length);
  const turns = Buffer.alloc(4 * all.length);
  const byte = (x: number) => Math.max(0, Math.min(255, Math.round(x)));
  all.forEach(({ mean, turn }, i) => {
    mean.forEach((x, k) => places.writeIntLE(Math.round(4096 * x), 9 * i + 3 * k, 3));
    const sizes = turn.map(Math.abs);
    const largest = sizes.indexOf(Math.max(...sizes));
    const sign = Math.sign(turn[largest]!);
    let bits = largest;
    turn.forEach((x, k) => {
      if (k === largest) return;
      const size = Math.round(511 * Math.SQRT2 * Math.abs(x));
      bits = bits * 1024 + (x * sign < 0 ? 512 : 0) + Math.min(511, size);
    });
    turns.writeUInt32LE(bits, 4 * i);
  });
  const arrays = [
    ...[places, Buffer.from(all.map(({ opacity }) => byte(255 * opacity)))],
    Buffer.from(all.flatMap((one) => harmonics(one).map((f) => byte(255 * (0.5 + 0.15 * f))))),
    Buffer.from(all.flatMap(({ sigma }) => sigma.map((s) => byte(16 * (Math.log(s) + 10))))),
    turns,
  ];
  return gzipSync(Buffer.concat([header, ...arrays]));
}

/** With a node that moves it by `moved` [m]. */
export function glbOf(all: readonly Made[], moved: Vec3): Buffer {
  const columns: [string, string, (one: Made) => readonly number[]][] = [
    ["POSITION", "VEC3", ({ mean }) => mean],
    ["KHR_gaussian_splatting:SCALE", "VEC3", ({ sigma }) => sigma],
    ["KHR_gaussian_splatting:ROTATION", "VEC4", ({ turn }) => turn],
    ["KHR_gaussian_splatting:OPACITY", "SCALAR", ({ opacity }) => [opacity]],
    ["KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", harmonics],
  ];
  const parts = columns.map(([, , of]) => Buffer.from(Float32Array.from(all.flatMap(of)).buffer));
  let byteOffset = 0;
  const bufferViews = parts.map(({ length: byteLength }) => {
    const view = { buffer: 0, byteOffset, byteLength };
    byteOffset += byteLength;
    return view;
  });
  const primitive = {
    mode: 0,
    attributes: Object.fromEntries(columns.map(([name], i) => [name, i])),
    extensions: {
      KHR_gaussian_splatting: { kernel: "ellipse", colorSpace: "srgb_rec709_display" },
    },
  };
  const root = {
    ...{ asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }] },
    ...{ nodes: [{ mesh: 0, translation: moved }], meshes: [{ primitives: [primitive] }] },
    accessors: columns.map(([, type], bufferView) => ({
      ...{ bufferView, type, componentType: 5126, count: all.length },
    })),
    ...{ bufferViews, buffers: [{ byteLength: byteOffset }] },
  };
  const text = JSON.stringify(root);
  const json = Buffer.from(text.padEnd(Math.ceil(text.length / 4) * 4));
  const chunk = (kind: string, content: Buffer) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(content.length);
    head.write(kind, 4, "latin1");
    return Buffer.concat([head, content]);
  };
  const chunks = Buffer.concat([chunk("JSON", json), chunk("BIN\0", Buffer.concat(parts))]);
  const header = Buffer.from("glTF\x02\0\0\0\0\0\0\0", "latin1");
  header.writeUInt32LE(12 + chunks.length, 8);
  return Buffer.concat([header, chunks]);
}

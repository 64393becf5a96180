// SPDX-License-Identifier: Apache-2.0
// A splat's file as Gaussians in the world, to be drawn: a PLY of 3D Gaussian splatting, SPZ of
// versions 1 to 4, or a GLB with KHR_gaussian_splatting. The program has checked it before.

import { decompress } from "fzstd";
import { Matrix4, Quaternion, Vector3 } from "three";

const OF_DEGREE_0 = 0.5 * Math.sqrt(1 / Math.PI); // spherical harmonic
const SPLATTING = "KHR_gaussian_splatting";

/** Gaussians in the world; of each three numbers, six, and four. */
export class Gaussians {
  /** [m] x y z */
  readonly means: Float32Array;
  /** [m^2] xx xy xz yy yz zz */
  readonly covariances: Float32Array;
  /** red, green, blue and opacity, 0 to 255 */
  readonly colours: Uint8ClampedArray;
  count = 0;

  constructor(most: number) {
    this.means = new Float32Array(3 * most);
    this.covariances = new Float32Array(6 * most);
    this.colours = new Uint8ClampedArray(4 * most);
  }

  /** @param m  world_from_file, 3 x 4, row by row @param turn  x y z w, of any length */
  add(
    m: ArrayLike<number>,
    mean: ArrayLike<number>,
    sigma: ArrayLike<number>,
    turn: ArrayLike<number>,
    colour: ArrayLike<number>,
    opacity: number,
  ): void {
    const i = this.count++;
    const [x, y, z, w] = unitTurn(turn);
    const axes = [
      ...[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
      ...[2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
      ...[2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ];
    const half = []; // m axes sigma, whose product with its transpose is the covariance
    for (let row = 0; row < 3; ++row) {
      const [a, b, c] = [m[4 * row]!, m[4 * row + 1]!, m[4 * row + 2]!];
      this.means[3 * i + row] = a * mean[0]! + b * mean[1]! + c * mean[2]! + m[4 * row + 3]!;
      for (let k = 0; k < 3; ++k)
        half.push((a * axes[k]! + b * axes[3 + k]! + c * axes[6 + k]!) * sigma[k]!);
      this.colours[4 * i + row] = 255 * colour[row]!;
    }
    let at = 6 * i;
    for (let row = 0; row < 3; ++row)
      for (let column = row; column < 3; ++column)
        this.covariances[at++] =
          half[3 * row]! * half[3 * column]! +
          half[3 * row + 1]! * half[3 * column + 1]! +
          half[3 * row + 2]! * half[3 * column + 2]!;
    this.colours[4 * i + 3] = 255 * opacity;
  }
}

function unitTurn(turn: ArrayLike<number>): [number, number, number, number] {
  const one = 1 / (Math.hypot(turn[0]!, turn[1]!, turn[2]!, turn[3]!) || 1);
  return [turn[0]! * one, turn[1]! * one, turn[2]! * one, turn[3]! * one];
}

const colourOf = (f: number): number => 0.5 + OF_DEGREE_0 * f;
const ofLogit = (x: number): number => 1 / (1 + Math.exp(-x));

/** @param pose  world_from_file, 3 x 4, row by row @throws Error saying why it cannot be drawn */
export async function readSplat(
  name: string,
  bytes: ArrayBuffer,
  pose: readonly number[],
): Promise<Gaussians> {
  const ending = name.toLowerCase().split(".").pop();
  if (ending === "ply") return readPly(bytes, pose);
  if (ending === "spz") return readSpz(await unpacked(bytes), pose);
  if (ending === "glb") return readGlb(bytes, pose);
  throw new Error(`a .${ending} is not drawn as a splat; write it as .ply, .spz or .glb`);
}

const NGSP = 0x5053474e;

// An SPZ's header and arrays: one gzip, or from version 4 on each array packed by zstd.
async function unpacked(bytes: ArrayBuffer): Promise<ArrayBuffer> {
  const view = new DataView(bytes);
  if (view.getUint32(0, true) !== NGSP) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }
  const [arrays, table] = [view.getUint8(15), view.getUint32(16, true)];
  const parts: BlobPart[] = [bytes.slice(0, 16)];
  let at = table + 16 * arrays;
  for (let i = 0; i < arrays; ++i) {
    const size = Number(view.getBigUint64(table + 16 * i, true));
    parts.push(decompress(new Uint8Array(bytes, at, size)) as Uint8Array<ArrayBuffer>);
    at += size;
  }
  return new Blob(parts).arrayBuffer();
}

type Read = (view: DataView, at: number, little: boolean) => number;
const PLY_TYPES: Record<string, readonly [size: number, read: Read]> = {};
for (const [names, size, read] of [
  ["char int8", 1, (view, at) => view.getInt8(at)],
  ["uchar uint8", 1, (view, at) => view.getUint8(at)],
  ["short int16", 2, (view, at, little) => view.getInt16(at, little)],
  ["ushort uint16", 2, (view, at, little) => view.getUint16(at, little)],
  ["int int32", 4, (view, at, little) => view.getInt32(at, little)],
  ["uint uint32", 4, (view, at, little) => view.getUint32(at, little)],
  ["float float32", 4, (view, at, little) => view.getFloat32(at, little)],
  ["double float64", 8, (view, at, little) => view.getFloat64(at, little)],
] as [string, number, Read][])
  for (const each of names.split(" ")) PLY_TYPES[each] = [size, read];

function readPly(bytes: ArrayBuffer, pose: readonly number[]): Gaussians {
  const start = new TextDecoder("latin1").decode(bytes.slice(0, 65_536));
  const end = /end_header\r?\n/.exec(start)!;
  const lines = start.slice(0, end.index).split(/\r?\n/);
  const format = /^format (\S+)/m.exec(start)![1]!;
  const first = lines.findIndex((line) => line.startsWith("element "));
  const [, kind, count] = lines[first]!.split(/\s+/);
  if (kind !== "vertex") throw new Error("its Gaussians are not the first element of the PLY");
  const after = lines.slice(first + 1);
  const others = after.findIndex((line) => line.startsWith("element "));
  let row = 0; // [B], or columns of an ascii file
  const places = new Map<string, readonly [at: number, read: Read]>();
  for (const line of after.slice(0, others < 0 ? undefined : others)) {
    const [word, type, name] = line.trim().split(/\s+/);
    if (word !== "property") continue;
    const [size, read] = PLY_TYPES[type!] ?? [];
    if (!size) throw new Error("its Gaussians have lists");
    places.set(name!, [row, read!]);
    row += format === "ascii" ? 1 : size;
  }
  const begin = end.index + end[0].length;
  const view = new DataView(bytes, begin);
  const words =
    format === "ascii"
      ? new TextDecoder().decode(bytes.slice(begin)).trim().split(/\s+/)
      : null;
  const little = format === "binary_little_endian";
  const column = (name: string) => {
    const [at, read] = places.get(name) ?? [];
    if (at === undefined) return () => 0;
    return words
      ? (i: number) => Number(words[row * i + at])
      : (i: number) => read!(view, row * i + at, little);
  };
  const columns = (names: string) => {
    const each = names.split(" ").map(column);
    return (i: number) => each.map((of) => of(i));
  };
  const [mean, logs] = [columns("x y z"), columns("scale_0 scale_1 scale_2")];
  const [turn, colour] = [columns("rot_1 rot_2 rot_3 rot_0"), columns("f_dc_0 f_dc_1 f_dc_2")];
  const opacity = column("opacity");
  const all = new Gaussians(Number(count));
  for (let i = 0; i < Number(count); ++i)
    all.add(
      pose,
      mean(i),
      logs(i).map(Math.exp),
      turn(i),
      colour(i).map(colourOf),
      ofLogit(opacity(i)),
    );
  return all;
}

function ofHalf(half: number): number {
  const [exponent, mantissa] = [(half >> 10) & 31, half & 1023];
  const size = exponent ? (1024 + mantissa) * 2 ** (exponent - 25) : mantissa * 2 ** -24;
  return half & 0x8000 ? -size : size;
}

function readSpz(bytes: ArrayBuffer, pose: readonly number[]): Gaussians {
  const view = new DataView(bytes);
  const version = view.getUint32(4, true);
  const count = view.getUint32(8, true);
  const unit = 2 ** -view.getUint8(13);
  const size = version === 1 ? 2 : 3; // [B] of a coordinate
  const opacities = 16 + 3 * size * count;
  const colours = opacities + count;
  const scales = colours + 3 * count;
  const turns = scales + 3 * count;
  const byte = (at: number) => view.getUint8(at);
  const place = (at: number) =>
    size === 2
      ? ofHalf(view.getUint16(at, true))
      : unit * ((view.getInt8(at + 2) << 16) | view.getUint16(at, true));
  const turn = (i: number): number[] => {
    const q = [0, 0, 0, 0];
    if (version < 3) {
      for (const k of [0, 1, 2]) q[k] = byte(turns + 3 * i + k) / 127.5 - 1;
      q[3] = Math.sqrt(Math.max(0, 1 - q[0]! ** 2 - q[1]! ** 2 - q[2]! ** 2));
      return q;
    }
    // The three smallest components of 10 bits each, of which the first is the sign.
    let bits = view.getUint32(turns + 4 * i, true);
    const largest = bits >>> 30;
    for (let k = 3; k >= 0; --k) {
      if (k === largest) continue;
      q[k] = ((bits & 511) / 511) * Math.SQRT1_2 * (bits & 512 ? -1 : 1);
      bits >>>= 10;
    }
    q[largest] = Math.sqrt(Math.max(0, 1 - Math.hypot(...q) ** 2));
    return q;
  };
  const all = new Gaussians(count);
  const three = [0, 1, 2] as const;
  for (let i = 0; i < count; ++i)
    all.add(
      pose,
      three.map((k) => place(16 + size * (3 * i + k))),
      three.map((k) => Math.exp(byte(scales + 3 * i + k) / 16 - 10)),
      turn(i),
      three.map((k) => colourOf((byte(colours + 3 * i + k) / 255 - 0.5) / 0.15)),
      byte(opacities + i) / 255,
    );
  return all;
}

// Of each component type of glTF: its numbers, and what a normalised 1 is.
const GLTF_TYPES: Record<number, readonly [Read, size: number, one: number]> = {
  5120: [PLY_TYPES.char![1], 1, 127],
  5121: [PLY_TYPES.uchar![1], 1, 255],
  5122: [PLY_TYPES.short![1], 2, 32767],
  5123: [PLY_TYPES.ushort![1], 2, 65535],
  5126: [PLY_TYPES.float![1], 4, 1],
};

function readGlb(bytes: ArrayBuffer, pose: readonly number[]): Gaussians {
  const file = new DataView(bytes);
  let [root, binary]: [any, number] = [null, 0];
  for (let at = 12; at + 8 <= bytes.byteLength; at += 8 + file.getUint32(at, true)) {
    const chunk = bytes.slice(at + 8, at + 8 + file.getUint32(at, true));
    const isJson = file.getUint32(at + 4, true) === 0x4e4f534a;
    if (isJson) root ??= JSON.parse(new TextDecoder().decode(chunk));
    else binary ||= at + 8;
  }
  const width: Record<string, number> = { SCALAR: 1, VEC3: 3, VEC4: 4 };
  const values = (number: number) => {
    const it = root.accessors[number];
    const of = root.bufferViews[it.bufferView];
    const [read, size, one] = GLTF_TYPES[it.componentType]!;
    const wide = width[it.type]!;
    const begin = binary + (of.byteOffset ?? 0) + (it.byteOffset ?? 0);
    const step = of.byteStride ?? wide * size;
    const unit = it.normalized ? 1 / one : 1;
    return (i: number) =>
      Array.from({ length: wide }, (_, k) => unit * read(file, begin + i * step + k * size, true));
  };
  const found: { primitive: any; pose: number[] }[] = [];
  const visit = (number: number, parent: Matrix4): void => {
    const { matrix, translation, rotation, scale, mesh, children } = root.nodes[number];
    const own = matrix
      ? new Matrix4().fromArray(matrix)
      : new Matrix4().compose(
          new Vector3(...(translation ?? [0, 0, 0])),
          new Quaternion(...(rotation ?? [0, 0, 0, 1])),
          new Vector3(...(scale ?? [1, 1, 1])),
        );
    own.premultiply(parent);
    for (const primitive of mesh === undefined ? [] : root.meshes[mesh].primitives)
      if (primitive.extensions?.[SPLATTING])
        found.push({ primitive, pose: own.clone().transpose().elements.slice(0, 12) });
    for (const child of children ?? []) visit(child, own);
  };
  const world = new Matrix4().set(...([...pose, 0, 0, 0, 1] as Parameters<Matrix4["set"]>));
  const scene = root.scenes?.[root.scene ?? 0].nodes ?? root.nodes.map((_: any, i: number) => i);
  for (const node of scene) visit(node, world);
  const counts = found.map(({ primitive }) => root.accessors[primitive.attributes.POSITION].count);
  const all = new Gaussians(counts.reduce((sum, count) => sum + count, 0));
  found.forEach(({ primitive: { attributes }, pose }, k) => {
    const of = (name: string) => values(attributes[`${SPLATTING}:${name}`]);
    const [mean, sigma] = [values(attributes.POSITION), of("SCALE")];
    const [turn, opacity] = [of("ROTATION"), of("OPACITY")];
    const harmonic = attributes[`${SPLATTING}:SH_DEGREE_0_COEF_0`];
    const plain = attributes.COLOR_0;
    const colour =
      harmonic !== undefined
        ? ((read) => (i: number) => read(i).map(colourOf))(values(harmonic))
        : plain !== undefined
          ? values(plain)
          : () => [0.5, 0.5, 0.5];
    const count = counts[k]!;
    let areLogs = false; // as in drafts of the extension
    for (let i = 0; i < count && !areLogs; ++i) areLogs = sigma(i).some((s) => s < 0);
    for (let i = 0; i < count; ++i)
      all.add(
        pose,
        mean(i),
        areLogs ? sigma(i).map(Math.exp) : sigma(i),
        turn(i),
        colour(i),
        opacity(i)[0]!,
      );
  });
  return all;
}

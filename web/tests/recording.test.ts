// SPDX-License-Identifier: Apache-2.0
// A recording of the program's, read by a decoder of others and ROS 2's own message definitions.

import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { definitions } from "./definitions";

const PYTHON = "/usr/bin/python3"; // a reader of MCAP that is not the program's
const program = process.env.PALPATE;
const folder = mkdtempSync(join(tmpdir(), "palpate-recording-"));

interface Message {
  topic: string;
  type: string;
  stamp: string; // [ns]
  value: any;
}

function read(file: string): Message[] {
  const script = "../scripts/mcap_messages.py";
  const rows = execFileSync(PYTHON, ["-B", script, file], { maxBuffer: 1 << 28 });
  const readers = new Map<string, MessageReader>();
  const messages: Message[] = [];
  for (const line of rows.toString().trim().split("\n")) {
    const [topic, type, stamp, data, definition] = JSON.parse(line) as string[];
    const bytes = Buffer.from(data!, "base64");
    const value = new MessageReader(definitions(type!)).readMessage(bytes);
    // The file's own definition says the same as ROS 2's.
    if (!readers.has(type!)) {
      const own = new MessageReader(parse(definition!, { ros2: true }));
      readers.set(type!, own);
      expect(own.readMessage(bytes)).toEqual(value);
    }
    messages.push({ topic: topic!, type: type!, stamp: stamp!, value });
  }
  return messages;
}

afterAll(() => rmSync(folder, { recursive: true }));

describe.skipIf(!program || !existsSync(PYTHON))("a recording", () => {
  let messages: Message[];
  const of = (topic: string) => messages.filter((message) => message.topic === topic);

  beforeAll(() => {
    const bag = join(folder, "bag");
    const camera = "synthetic:desk?size=160x120";
    execFileSync(program!, [
      ...["run", "--headless", "--duration", "2", "--record", bag],
      ...["--camera", camera, "--set", "damping=0.3"],
    ]);
    messages = read(join(bag, "bag_0.mcap"));
  }, 60_000);

  test("has each of its messages readable by ROS 2's definitions", () => {
    expect(of("/palpate/tick")).toHaveLength(2000);
    expect(of("/palpate/hip")).toHaveLength(2000);
    expect(of("/camera_0/depth/image_raw/compressedDepth")).toHaveLength(60);
    expect(new Set(messages.map((message) => message.type))).toEqual(
      new Set([
        "std_msgs/msg/String",
        "std_msgs/msg/Float64MultiArray",
        "sensor_msgs/msg/CompressedImage",
        "sensor_msgs/msg/CameraInfo",
        "tf2_msgs/msg/TFMessage",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/WrenchStamped",
      ]),
    );
  });

  test("says the same of a tick in its standard messages and in its exact ones", () => {
    const session = JSON.parse(of("/palpate/session")[0]!.value.data);
    const columns: string[] = session.tick_columns;
    const at = (row: Float64Array, name: string) => [
      ...["_x", "_y", "_z"].map((axis) => row[columns.indexOf(name + axis)]),
    ];
    let felt = 0;
    of("/palpate/tick").forEach(({ value, stamp }, i) => {
      const row = value.data as Float64Array;
      expect(row).toHaveLength(columns.length);
      expect(row[columns.indexOf("number")]).toBe(i);
      const hip = of("/palpate/hip");
      const { header, pose } = hip[i]!.value;
      expect([pose.position.x, pose.position.y, pose.position.z]).toEqual(at(row, "hip"));
      expect(header.frame_id).toBe("world");
      expect(hip[i]!.stamp).toBe(stamp);
      felt = Math.max(felt, Math.hypot(...(at(row, "force") as number[])));
    });
    expect(felt).toBeGreaterThan(1);
    const forces = of("/palpate/force").map(({ value }) => value.wrench.force);
    expect(Math.max(...forces.map(({ x, y, z }) => Math.hypot(x, y, z)))).toBe(felt);
  }, 60_000);

  test("has a camera with its intrinsics, its place and packed depth", () => {
    const info = of("/camera_0/depth/camera_info")[0]!.value;
    expect([info.width, info.height]).toEqual([160, 120]);
    expect(info.distortion_model).toBe("plumb_bob");
    const image = of("/camera_0/depth/image_raw/compressedDepth")[0]!.value;
    expect(image.format).toBe("16UC1; compressedDepth rvl; units_per_metre=10000");
    expect(image.header).toEqual({ ...info.header, frame_id: "camera_0_optical_frame" });
    const rvl = Buffer.from(image.data).subarray(12);
    expect([rvl.readUInt32LE(0), rvl.readUInt32LE(4)]).toEqual([160, 120]);
    const [{ child_frame_id, transform }] = of("/tf")[0]!.value.transforms;
    expect(child_frame_id).toBe("camera_0_optical_frame");
    const { x, y, z, w } = transform.rotation;
    expect(Math.hypot(x, y, z, w)).toBeCloseTo(1, 12);
  });
});

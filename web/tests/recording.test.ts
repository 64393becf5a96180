// SPDX-License-Identifier: Apache-2.0
// A recording of the program's, read by a decoder of others and ROS 2's own message definitions.

import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { definitions } from "./definitions";

const PYTHON = "/usr/bin/python3"; // whose sqlite3 is another reader than the program's
const program = process.env.PALPATE;
const folder = mkdtempSync(join(tmpdir(), "palpate-recording-"));

interface Message {
  topic: string;
  type: string;
  stamp: string; // [ns]
  value: any;
}

const DUMP = `
import base64, json, sqlite3, sys
bag = sqlite3.connect(sys.argv[1])
for row in bag.execute("select name, type, timestamp, data from messages"
                       " join topics on topics.id = topic_id order by messages.id"):
    print(json.dumps([row[0], row[1], str(row[2]), base64.b64encode(row[3]).decode()]))
`;

function read(file: string): Message[] {
  const rows = execFileSync(PYTHON, ["-B", "-c", DUMP, file], { maxBuffer: 1 << 28 });
  const readers = new Map<string, MessageReader>();
  const messages: Message[] = [];
  for (const line of rows.toString().trim().split("\n")) {
    const [topic, type, stamp, data] = JSON.parse(line) as [string, string, string, string];
    if (!readers.has(type)) readers.set(type, new MessageReader(definitions(type)));
    const bytes = Buffer.from(data, "base64");
    messages.push({ topic, type, stamp, value: readers.get(type)!.readMessage(bytes) });
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
    messages = read(join(bag, "bag_0.db3"));
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
    expect(image.format).toBe("16UC1; compressedDepth png; units_per_metre=10000");
    expect(image.header).toEqual({ ...info.header, frame_id: "camera_0_optical_frame" });
    const png = Buffer.from(image.data).subarray(12);
    expect(png.subarray(1, 4).toString()).toBe("PNG");
    expect([png.readUInt32BE(16), png.readUInt32BE(20), png[24]]).toEqual([160, 120, 16]);
    const [{ child_frame_id, transform }] = of("/tf")[0]!.value.transforms;
    expect(child_frame_id).toBe("camera_0_optical_frame");
    const { x, y, z, w } = transform.rotation;
    expect(Math.hypot(x, y, z, w)).toBeCloseTo(1, 12);
  });
});

// SPDX-License-Identifier: Apache-2.0
// What the program publishes on the network of ROS 2, read by another implementation of its
// protocol and by ROS 2's own message definitions.

import { spawn, type ChildProcess } from "node:child_process";
import { once } from "node:events";
import { networkInterfaces } from "node:os";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { Durability, HistoryKind, Participant, Reliability } from "@foxglove/rtps";
import { UdpSocketNode } from "@foxglove/rtps/nodejs";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { definitions } from "./definitions";

const program = process.env.PALPATE;
const TYPES: Record<string, string> = {
  "/palpate/proxy": "geometry_msgs/msg/PoseStamped",
  "/palpate/hip": "geometry_msgs/msg/PoseStamped",
  "/palpate/force": "geometry_msgs/msg/WrenchStamped",
  "/palpate/normal": "geometry_msgs/msg/Vector3Stamped",
  "/palpate/contact": "std_msgs/msg/UInt8",
  "/palpate/flags": "std_msgs/msg/UInt32",
  "/palpate/markers": "visualization_msgs/msg/MarkerArray",
  "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
  "/eye/depth/camera_info": "sensor_msgs/msg/CameraInfo",
  "/eye/depth/image_raw/compressedDepth": "sensor_msgs/msg/CompressedImage",
  "/eye/depth/image_raw/slices": "sensor_msgs/msg/CompressedImage",
  "/tf": "tf2_msgs/msg/TFMessage",
};
const LONG = 60_000; // [ms] on a busy machine

// The network by which others are found: multicast goes there.
const address = Object.values(networkInterfaces())
  .flat()
  .find((one) => one && one.family === "IPv4" && !one.internal)?.address;

describe.skipIf(!program || !address)("on the network of ROS 2", () => {
  const domain = 120 + (process.pid % 100);
  const env = { ...process.env, ROS_DOMAIN_ID: String(domain) };
  const messages = new Map<string, any[]>();
  const numbers = new Map<any, bigint>(); // of each message, as its writer counted
  const errors: string[] = [];
  const programs: ChildProcess[] = [];
  let participant: Participant | undefined;
  let canHear = false; // is multicast let through on this machine?

  const heard = async (topics: string[]) => {
    const end = Date.now() + LONG;
    while (Date.now() < end && !topics.every((topic) => messages.has(topic)))
      await new Promise((wake) => setTimeout(wake, 50));
  };

  beforeAll(async () => {
    const camera = ["--camera", "synthetic:plane?size=64x48"];
    programs.push(
      spawn(program!, ["ros", ...camera], { env, stdio: "ignore" }),
      spawn(program!, ["serve-camera", ...camera, "--name", "eye"], { env, stdio: "ignore" }),
    );
    const say = { debug() {}, info() {}, warn() {}, error: (what: any) => errors.push(`${what}`) };
    participant = new Participant({
      name: "another",
      addresses: [address!],
      domainId: domain,
      udpSocketCreate: UdpSocketNode.Create,
      log: say as any,
    });
    participant.on("discoveredPublication", () => (canHear = true));
    const readers = new Map(
      Object.entries(TYPES).map(([topic, type]) => [topic, new MessageReader(definitions(type))]),
    );
    participant.on("userData", (message) => {
      const topic = message.publication.topicName!.replace(/^rt/, "");
      const kept = messages.get(topic) ?? [];
      messages.set(topic, kept);
      if (kept.length >= 50) return;
      const content = readers.get(topic)!.readMessage(message.serializedData);
      numbers.set(content, message.writerSeqNumber);
      kept.push(content);
    });
    await participant.start();
    for (const [topic, type] of Object.entries(TYPES)) {
      participant.subscribe({
        topicName: `rt${topic}`,
        typeName: type.replace("/msg/", "::msg::dds_::") + "_",
        durability: Durability.Volatile,
        history: { kind: HistoryKind.KeepLast, depth: 10 },
        reliability: {
          kind: topic.endsWith("/slices") ? Reliability.BestEffort : Reliability.Reliable,
          maxBlockingTime: { sec: 1, nsec: 0 },
        },
      });
    }
    await heard(Object.keys(TYPES));
  }, 2 * LONG);

  afterAll(async () => {
    participant?.shutdown();
    for (const child of programs) {
      child.kill("SIGTERM");
      if (child.exitCode === null) await once(child, "exit");
    }
  }, LONG);

  test("another implementation hears every topic", ({ skip }) => {
    if (!canHear) return skip("no multicast between programs on this machine");
    expect([...messages.keys()].sort()).toEqual(Object.keys(TYPES).sort());
    expect(errors).toEqual([]);
  });

  test("a node says where proxy and hand are, what is felt, and how it is", ({ skip }) => {
    if (!canHear) return skip("no multicast between programs on this machine");
    const [proxy] = messages.get("/palpate/proxy")!;
    expect(proxy.header.frame_id).toBe("world");
    expect(Math.hypot(...Object.values(proxy.pose.orientation as Record<string, number>))).toBe(1);
    for (const hip of messages.get("/palpate/hip")!)
      expect(Math.abs(hip.pose.position.z)).toBeLessThan(1);
    const forces = messages.get("/palpate/force")!;
    for (const { wrench } of forces)
      expect(Math.hypot(...(Object.values(wrench.force) as number[]))).toBeLessThan(4);
    // A message that was lost is sent again, and then comes after later ones.
    const stamps = [...forces]
      .sort((a, b) => Number(numbers.get(a)! - numbers.get(b)!))
      .map(({ header }) => header.stamp.sec + 1e-9 * header.stamp.nsec);
    expect(Math.abs(stamps[0]! - Date.now() / 1000)).toBeLessThan(120);
    for (let i = 1; i < stamps.length; ++i) expect(stamps[i]).toBeGreaterThan(stamps[i - 1]!);
    expect([0, 1, 2]).toContain(messages.get("/palpate/contact")![0].data);
    expect(messages.get("/palpate/markers")![0].markers.length).toBeGreaterThan(3);
    const names = messages.get("/diagnostics")![0].status.map((status: any) => status.name);
    expect(names.join()).toMatch(/loop/);
  });

  test("a camera's lens, depth and pose", ({ skip }) => {
    if (!canHear) return skip("no multicast between programs on this machine");
    const [lens] = messages.get("/eye/depth/camera_info")!;
    expect([lens.width, lens.height]).toEqual([64, 48]);
    expect(lens.k[0]).toBeCloseTo(32 / Math.tan((57 / 2) * (Math.PI / 180)), 6);
    const [image] = messages.get("/eye/depth/image_raw/compressedDepth")!;
    expect(image.format).toBe("16UC1; compressedDepth rvl; units_per_metre=10000");
    const sides = new DataView(image.data.buffer, image.data.byteOffset + 12, 8);
    expect([sides.getUint32(0, true), sides.getUint32(4, true)]).toEqual([64, 48]);
    expect(messages.get("/eye/depth/image_raw/slices")![0].format).toMatch(/^16UC1; slice rvl/);
    const [tf] = messages.get("/tf")!;
    expect(tf.transforms[0].header.frame_id).toBe("world");
    expect(tf.transforms[0].child_frame_id).toBe("eye_optical_frame");
  });
});

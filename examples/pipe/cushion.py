#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A method behind a pipe, docs/bench-entries.md: pushes the hand away from the points near it."""
import array
import json
import math
import struct
import sys


def read(size):
    data = sys.stdin.buffer.read(size)
    if len(data) < size:  # the bench is done with this program
        sys.exit(0)
    return data


def answer(letters, payload=b""):
    sys.stdout.buffer.write(letters + struct.pack("<I", len(payload)) + payload)
    sys.stdout.buffer.flush()


def tick(hip, near, viewpoint, stiffness):
    """Proxy, force and normal at a HIP, of which the points within 35 mm are `near`."""
    ball = [p for p in near if math.dist(p, hip) < 0.035]
    if len(ball) < 5:
        return *hip, 0, 0, 0, 0, 0, 0
    mean = [sum(p[i] for p in ball) / len(ball) for i in range(3)]
    away = [viewpoint[i] - mean[i] for i in range(3)]
    normal = [a / math.hypot(*away) for a in away]
    depth = sum(n * (m - h) for n, m, h in zip(normal, mean, hip))
    if depth <= 0:
        return *hip, 0, 0, 0, *normal
    proxy = [h + (depth + 0.005) * n for h, n in zip(hip, normal)]
    return *proxy, *(min(stiffness * depth, 20) * n for n in normal), *normal


frame, near, middle, viewpoint, stiffness = array.array("f"), [], None, (0, 0, 0), 0
while True:
    letters, size = struct.unpack("<4sI", read(8))
    payload = read(size)
    if letters == b"INIT":
        stiffness = json.loads(payload)["stiffness"]
        answer(b"INIT", b"cushion")
    elif letters == b"FRAM":
        viewpoint = struct.unpack_from("<3d", payload, 8)
        frame = array.array("f", payload[44:])
        middle = None
    elif letters == b"TICK":
        hip = struct.unpack_from("<3d", payload, 8)
        if middle is None or math.dist(hip, middle) > 0.02:  # all that matters for some ticks
            middle = hip
            near = [p for p in zip(frame[0::3], frame[1::3], frame[2::3])
                    if abs(p[0] - hip[0]) < 0.06 and math.dist(p, hip) < 0.06]
        answer(b"TICK", struct.pack("<9d", *tick(hip, near, viewpoint, stiffness)))

# SPDX-License-Identifier: Apache-2.0
"""Haply's Inverse Service with an Inverse3 that nobody sees: inverse_service.py BENCH

Written from the service's documentation alone. It speaks first, with an inventory; then it answers
each message with one state. A force stays until the next message, also when nobody speaks to it
any more, which the real one does not promise. BENCH is a file of 24 doubles
that the test maps, too: the names below are their places.
"""
import base64
import hashlib
import json
import math
import mmap
import select
import socket
import struct
import sys
import threading
import time

# By the test
PLUGGED_IN, CALIBRATED, HANGS, DROPS, VERSION, SAYS_VERSION = range(6)
# By this
PORT, FORCE_X, FORCE_Y, FORCE_Z, LARGEST, LARGEST_FIRST, COMMANDS, CONNECTIONS, DROPPED, BEGAN = \
    range(6, 16)
FELL, HEARD, LONGEST_GAP = 18, 19, 20  # [s] when a force ended, the newest message, between two
LATE, BEHIND = 16, 17  # by the test: answers to come late; messages before the last one's answer


class Bench:
    def __init__(self, path):
        with open(path, "r+b") as file:
            self.memory = mmap.mmap(file.fileno(), 24 * 8)

    def __getitem__(self, place):
        return struct.unpack_from("d", self.memory, 8 * place)[0]

    def __setitem__(self, place, value):
        struct.pack_into("d", self.memory, 8 * place, value)


def receive(connection, size):
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise ConnectionError("closed")
        data += part
    return data


def receive_message(connection):
    """The next text message; None when the other side closes."""
    while True:
        head = receive(connection, 2)
        size = head[1] & 127
        if size == 126:
            size = struct.unpack(">H", receive(connection, 2))[0]
        elif size == 127:
            size = struct.unpack(">Q", receive(connection, 8))[0]
        mask = receive(connection, 4)
        repeated = (mask * (size // 4 + 1))[:size]
        data = (int.from_bytes(receive(connection, size), "big")
                ^ int.from_bytes(repeated, "big")).to_bytes(size, "big")
        if head[0] & 15 == 8:
            return None
        if head[0] & 15 == 1:
            return json.loads(data)


def send_message(connection, message):
    data = json.dumps(message).encode()
    head = struct.pack(">BB", 0x81, len(data)) if len(data) < 126 else \
        struct.pack(">BBH", 0x81, 126, len(data))
    connection.sendall(head + data)


def hand(bench):
    """[m] x right, y forward, z up: once a second down to 6 mm below z = 0.

    It begins when the session has run for half a second's ticks: one that is inside before the
    first frame comes touches the surface from behind.
    """
    now = time.monotonic()
    if bench[BEGAN] == 0.0 and bench[COMMANDS] > 500:
        bench[BEGAN] = now
    t = now - bench[BEGAN] if bench[BEGAN] > 0.0 else 0.0
    sway = 0.004 * math.sin(2.0 * t)
    return {"x": sway, "y": 0.5 * sway, "z": 0.004 + 0.01 * math.cos(2.0 * math.pi * t)}


def state_of(bench, whole):
    device = {"device_id": "049D", "state": {
        "cursor_position": hand(bench), "cursor_velocity": {"x": 0.0, "y": 0.0, "z": 0.0},
        "angular_position": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
        "current_cursor_force": dict(zip("xyz", (bench[FORCE_X], bench[FORCE_Y], bench[FORCE_Z]))),
        "control_domain": "cartesian", "control_mode": "idle"}}
    if whole:
        device["config"] = {"type": "inverse3", "handedness": "right", "preset": "defaults",
                            "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0}}}
        device["status"] = {"calibrated": bench[CALIBRATED] == 1.0, "in_use": False,
                            "power_supply": True, "ready": True, "started": True}
    if bench[PLUGGED_IN] != 1.0:
        return {"inverse3": []}
    return {"inverse3": [device],
            "verse_grip": [{"device_id": "61548", "state": {"button": True, "hall": 0}}]}


def obey(bench, message, before):
    """Takes the forces of a message, which came after one of `before` [N] in its connection: after
    a service that hung, the last of a connection that is gone may come between those of the next.
    @return [N] the size of the force
    """
    key = "vector" if bench[VERSION] >= 3.5 else "values"
    size = 0.0
    for device in message.get("inverse3", []):
        force = device.get("commands", {}).get("set_cursor_force", {}).get(key)
        if force is None:
            force = {"x": 0.0, "y": 0.0, "z": 0.0}
        size = math.hypot(force["x"], force["y"], force["z"])
        bench[FORCE_X], bench[FORCE_Y], bench[FORCE_Z] = force["x"], force["y"], force["z"]
        bench[COMMANDS] += 1
        now = time.monotonic()
        if bench[HEARD] > 0.0:
            bench[LONGEST_GAP] = max(bench[LONGEST_GAP], now - bench[HEARD])
        bench[HEARD] = now
        if before > 0.0 and size == 0.0:
            bench[FELL] = now
        bench[LARGEST] = max(bench[LARGEST], size)
        if before == 0.0:
            bench[LARGEST_FIRST] = max(bench[LARGEST_FIRST], size)
    return size


def serve(connection, bench):
    request = b""
    while b"\r\n\r\n" not in request:
        request += receive(connection, 1)
    lines = request.decode().split("\r\n")
    headers = {name.lower(): value.strip() for name, _, value in
               (line.partition(":") for line in lines[1:])}
    if lines[0].startswith("GET /version"):
        says = {"git_tag": "v%.1f.0" % bench[VERSION]} if bench[SAYS_VERSION] == 1.0 else {}
        body = json.dumps(says)
        connection.sendall(("HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
                            "Content-Length: %d\r\nConnection: close\r\n\r\n%s"
                            % (len(body), body)).encode())
        return
    accept = base64.b64encode(hashlib.sha1(
        (headers["sec-websocket-key"] + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest())
    connection.sendall(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                       b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept + b"\r\n\r\n")
    bench[CONNECTIONS] += 1
    send_message(connection, dict(session_id=7, **state_of(bench, True)))
    force = 0.0
    while True:
        message = receive_message(connection)
        if message is None:
            return
        while bench[HANGS] == 1.0:
            time.sleep(0.001)
        force = obey(bench, message, force)
        if bench[LATE] >= 1.0:
            bench[LATE] -= 1
            time.sleep(0.03)
        if select.select([connection], [], [], 0.0)[0]:
            bench[BEHIND] += 1
        if bench[DROPS] >= 1.0:
            bench[DROPS] -= 1
            bench[DROPPED] += 1
            continue
        send_message(connection, state_of(bench, False))


def main():
    bench = Bench(sys.argv[1])
    listener = socket.create_server(("127.0.0.1", 0))
    bench[PORT] = listener.getsockname()[1]
    while True:
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def talk(one=connection):
            try:
                serve(one, bench)
            except OSError:
                pass
            finally:
                one.close()
        threading.Thread(target=talk, daemon=True).start()


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A camera here, a hand there, and a poor link between them: what does the hand feel?

scripts/poor_link.py PALPATE [--delay MS] [--jitter MS] [--loss PERCENT] [--rate MBIT/S]
                     [--down AT:SECONDS] [--seconds S] [--camera URI] [--packing rvl|png]
                     [--way slices|images] [--loopback] [--table | --check]

Two network namespaces, joined by a link of this program's own (two TAP devices), which delays,
loses and holds up what goes through it, both ways: --delay on each way, with --jitter more or less
(drawn anew each 20 ms, in order), a queue of 250 ms at --rate, and nothing at all while the link is
down. In one of them `palpate serve-camera` serves CAMERA, in the other `palpate run --headless`
presses on it by a path, and records. Prints a line from that recording; with --table the lines of
docs/ros.md; with --loopback both are on this machine's own network, without a link, which needs no
root; with --check it exits 1 unless images came and the force was back after the link.

Needs root, /dev/net/tun and Cyclone DDS. Exits 77 where namespaces or TAP devices are not allowed.
"""
import argparse
import fcntl
import heapq
import math
import os
import pathlib
import random
import select
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

import mcap_messages

TUNSETIFF, TAP_WITHOUT_HEADER = 0x400454CA, 0x0002 | 0x1000
# Of the namespaces and the devices in them, which may have 15 letters
SIDES = tuple(f"palp{os.getpid()}{side}" for side in "ab")
QUEUE = 0.25  # [s] of a link of limited rate
HELD_UP = 0.02  # [s] between changes of the delay
LANDING = 3.0  # [s] of the path until the hand is down and the force has come up
DEPTH = 0.003  # [m] the hand is below the plane
STALLED = 12  # bit of a tick's safety: docs/recording.md
LEAST_FELT, FELT_FOR = 0.5, 200  # [N] of some 1.8, ticks
NOT_POSSIBLE = 77
TOPICS = {"slices": "slices?", "images": "compressedDepth?reliable&"}


class Link:
    """Carries Ethernet frames between two TAP devices until it is closed."""

    def __init__(self, options):
        self.options = options
        self.random = random.Random(1)
        self.is_open = True
        self.down_from = self.down_until = math.inf
        self.taps = []
        self.thread = threading.Thread(target=self.carry)
        try:
            for name, address in zip(SIDES, ("10.77.0.1/24", "10.77.0.2/24")):
                self.taps.append(self.tap(name))
                run("ip", "netns", "add", name)
                run("ip", "link", "set", name, "netns", name)
                up = f"link set {name} up"
                for command in (f"addr add {address} dev {name}", up, "link set lo up"):
                    run("ip", "-n", name, *command.split())
            self.thread.start()
        except BaseException:  # what was begun is undone
            self.close()
            raise

    @staticmethod
    def tap(name):
        tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH", name.encode(), TAP_WITHOUT_HEADER))
        except BaseException:
            os.close(tap)
            raise
        return tap

    def go_down(self, at, seconds):
        """From `at` [s, monotonic] on, for so long."""
        self.down_from, self.down_until = at, at + seconds

    def carry(self):
        waiting, count = [], 0
        free = [0.0, 0.0]  # [s] when what was sent before is through
        last, spread, spread_until = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        options = self.options
        while self.is_open:
            now = time.monotonic()
            pause = min(max(waiting[0][0] - now, 0.0), 0.1) if waiting else 0.1
            for tap in select.select(self.taps, [], [], pause)[0]:
                way = self.taps.index(tap)
                frame = os.read(tap, 65536)
                now = time.monotonic()
                if self.down_from <= now < self.down_until:
                    continue
                if self.random.random() < options.loss / 100.0:
                    continue
                due = now
                if options.rate:
                    if free[way] > now + QUEUE:
                        continue
                    due = free[way] = max(free[way], now) + 8e-6 * len(frame) / options.rate
                if now > spread_until[way]:
                    spread_until[way] = now + HELD_UP
                    spread[way] = self.random.uniform(-options.jitter, options.jitter)
                due += max(options.delay + spread[way], 0.0) / 1000.0
                due = last[way] = max(due, last[way])
                heapq.heappush(waiting, (due, count, 1 - way, frame))
                count += 1
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, to, frame = heapq.heappop(waiting)
                try:
                    os.write(self.taps[to], frame)
                except BlockingIOError:
                    pass  # its queue is full

    def close(self):
        self.is_open = False
        if self.thread.is_alive():
            self.thread.join()
        for tap in self.taps:
            os.close(tap)
        remove_namespaces()


def run(*command):
    subprocess.run(command, check=True, capture_output=True)


def remove_namespaces():
    for name in SIDES:
        subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def ticks_of(folder):
    """The numbers named here of each tick of a recording."""
    wanted = ("t", "hip_z", "force_z", "frame_age", "frame_number", "safety")
    names, ticks = [], []
    for topic, _, _, data, _ in mcap_messages.messages(next(folder.glob("*.mcap"))):
        if topic == "/palpate/session":
            names = data.decode(errors="replace").split('"tick_columns":[')[1].split("]")[0]
            names = [name.strip('"') for name in names.split(",")]
        elif topic == "/palpate/tick":
            numbers = dict(zip(names, struct.unpack(f"<{len(names)}d", data[-8 * len(names):])))
            ticks.append([numbers[name] for name in wanted])
    return ticks


def ripple(forces):
    """[N] rms of a force from 20 Hz on, of a tick each millisecond."""
    share = 1.0 / (1.0 + 1000.0 / (2.0 * math.pi * 20.0))
    slow, total = forces[0], 0.0
    for force in forces:
        slow += share * (force - slow)
        total += (force - slow) ** 2
    return math.sqrt(total / len(forces))


def measure(options, program, again=5):
    """One session over the link, for a table once more where this machine was too busy for it.

    Returns the values of its line by their names."""
    link = None if options.loopback else Link(options)
    environment = dict(os.environ)
    if options.loopback:
        environment.update(ROS_LOCALHOST_ONLY="1", ROS_DOMAIN_ID=str(100 + os.getpid() % 100))
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            path = folder / "press.csv"
            path.write_text("t,x,y,z\n0,0,0,0.05\n1,0,0,0.05\n2,0,0,%g\n%g,%g,0,%g\n" % (
                -DEPTH, options.seconds, 0.005 * (options.seconds - 2.0), -DEPTH))
            at = [[] if options.loopback else ["ip", "netns", "exec", name] for name in SIDES]
            server = subprocess.Popen(
                at[0] + [program, "serve-camera", "--camera", options.camera, "--name",
                        "far", "--packing", options.packing],
                stderr=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
            hand = subprocess.Popen(
                at[1] + [program, "run", "--headless", "--json", "--duration",
                        str(options.seconds), "--record", folder / "session", "--device",
                        f"script:{path}", "--camera",
                        "ros2:/far/depth/image_raw/" + TOPICS[options.way] + "wait=30s"],
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
            if options.down:
                down_at, seconds = (float(value) for value in options.down.split(":"))
                while hand.poll() is None and not list(folder.glob("session/*.mcap")):
                    time.sleep(0.01)
                link.go_down(time.monotonic() + down_at, seconds)
            _, said = hand.communicate()
            server.send_signal(signal.SIGINT)
            server.communicate()
            if hand.returncode != 0:
                sys.exit(f"poor_link: the session failed: {said.strip()}")
            ticks = ticks_of(folder / "session")
    finally:
        if link:
            link.close()
    start = ticks[0][0]
    up = start + (down_at + seconds if options.down else LANDING)
    if options.check:
        felt = sum(tick[2] > LEAST_FELT for tick in ticks if tick[0] > up)
        if felt < FELT_FOR or ticks[-1][4] < 10:
            sys.exit(f"poor_link: {ticks[-1][4]:.0f} images came, a force in {felt} ticks since "
                     "the link is up")
    pressed = [tick for tick in ticks if tick[0] - start > LANDING]
    forces = [tick[2] for tick in pressed]
    new = sorted(1e3 * tick[3] for before, tick in zip(pressed, pressed[1:]) if tick[4] > before[4])
    ages = sorted(1e3 * tick[3] for tick in pressed)
    steps = [abs(b - a) for a, b in zip(forces, forces[1:])]
    usual = statistics.median(forces)
    frames = (pressed[-1][4] - pressed[0][4]) / (pressed[-1][0] - pressed[0][0])
    without = sum(force < 0.2 * usual for force in forces)
    back = None
    if options.down:
        later = [tick[0] for tick in ticks if tick[0] > up and tick[2] > 0.8 * usual]
        back = later[0] - up if later else math.inf
    if sum(int(tick[5]) >> STALLED & 1 for tick in pressed):
        if options.table and again > 0:
            return measure(options, program, again - 1)
        print("poor_link: a busy machine: the session's own ticks came late", file=sys.stderr)
    return {"frames/s": f"{frames:.1f}", "age p50": f"{ages[len(ages) // 2]:.0f} ms",
            "p99": f"{ages[len(ages) * 99 // 100]:.0f} ms",
            "on arrival p50": f"{new[len(new) // 2]:.1f} ms",
            "p99 ": f"{new[len(new) * 99 // 100]:.1f} ms", "force": f"{usual:.2f} N",
            "largest step in 1 ms": f"{1e3 * max(steps):.0f} mN",
            "over 20 Hz": f"{1e3 * ripple(forces):.0f} mN", "without force": f"{without} ms",
            "back after": "" if back is None else f"{back:.2f} s"}


# Each way: delay [ms], jitter [ms], loss [%], rate [Mbit/s], cable pulled (at:seconds)
TABLE = [(0, 0, 0, 0, ""), (25, 5, 0, 0, ""), (50, 15, 0, 0, ""), (100, 0, 0, 0, ""),
         (100, 30, 0, 0, ""), (200, 0, 0, 0, ""), (0, 0, 5, 0, ""), (25, 5, 5, 0, ""),
         (100, 30, 5, 0, ""), (0, 0, 0, 20, ""), (25, 5, 0, 0, "6:1.5"), (100, 30, 5, 0, "6:1.5")]


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("program", metavar="PALPATE", help="such as build/run/app/palpate")
    for name, unit in (("delay", "ms"), ("jitter", "ms"), ("loss", "percent"), ("rate", "Mbit/s")):
        parser.add_argument("--" + name, type=float, default=0.0, help=f"[{unit}] (0)")
    parser.add_argument("--down", default="", help="the link is down: after, for [s]")
    parser.add_argument("--seconds", type=float, default=15.0, help="of the session (15)")
    parser.add_argument("--camera", default="synthetic:plane?sensor=d4xx", help="what is served")
    parser.add_argument("--packing", default="rvl", choices=("rvl", "png"))
    parser.add_argument("--way", default="slices", choices=sorted(TOPICS),
                        help="slices of images, or images that are sent again (slices)")
    parser.add_argument("--loopback", action="store_true", help="without a link, on this machine")
    parser.add_argument("--table", action="store_true", help="the lines of docs/ros.md")
    parser.add_argument("--check", action="store_true", help="fail if nothing is felt")
    options = parser.parse_args()
    may_link = os.geteuid() == 0 and os.access("/dev/net/tun", os.R_OK | os.W_OK)
    if not options.loopback and not may_link:
        print("poor_link: needs root and /dev/net/tun", file=sys.stderr)
        return NOT_POSSIBLE
    lines = TABLE if options.table else [
        (options.delay, options.jitter, options.loss, options.rate, options.down)]
    for number, line in enumerate(lines):
        options.delay, options.jitter, options.loss, options.rate, options.down = line
        try:
            row = measure(options, options.program)
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"poor_link: no namespace or TAP device can be made: {error}", file=sys.stderr)
            return NOT_POSSIBLE
        if number == 0:
            names = ["delay", "jitter", "loss", "rate", "down", *row]
            print("| " + " | ".join(names) + " |\n|" + "---|" * len(names))
        shown = [f"{line[0]:g} ms", f"{line[1]:g} ms", f"{line[2]:g} %",
                 f"{line[3]:g} Mbit/s" if line[3] else "", line[4]]
        print("| " + " | ".join([*shown, *row.values()]) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

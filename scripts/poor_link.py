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
import collections
import contextlib
import fcntl
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
Tick = collections.namedtuple("Tick", "t force_z frame_age frame_number safety")
TOPICS = {"slices": "slices?", "images": "compressedDepth?reliable&"}


class Way:
    """One way of the link: what is on it, in order."""

    def __init__(self, options):
        self.options = options
        self.waiting = collections.deque()  # ([s] when it arrives, frame)
        self.free = self.last = self.spread = self.spread_until = 0.0

    def send(self, frame, now, chance):
        options, due = self.options, now
        if chance.random() < options.loss / 100.0:
            return
        if options.rate:
            if self.free > now + QUEUE:
                return
            due = self.free = max(self.free, now) + 8e-6 * len(frame) / options.rate
        if now > self.spread_until:
            self.spread_until = now + HELD_UP
            self.spread = chance.uniform(-options.jitter, options.jitter)
        self.last = max(due + max(options.delay + self.spread, 0.0) / 1000.0, self.last)
        self.waiting.append((self.last, frame))


class Link(contextlib.ExitStack):
    """Carries Ethernet frames between two TAP devices until it is closed."""

    def __init__(self, options):
        super().__init__()
        self.options = options
        self.is_open = True
        self.down_from = self.down_until = math.inf
        self.taps = []
        with contextlib.ExitStack() as undo:  # what was begun, where a later step fails
            for name, address in zip(SIDES, ("10.77.0.1/24", "10.77.0.2/24")):
                self.taps.append(self.tap(name))
                undo.callback(os.close, self.taps[-1])
                undo.callback(subprocess.run, ["ip", "netns", "del", name], capture_output=True,
                              check=False)
                run("ip", "netns", "add", name)
                run("ip", "link", "set", name, "netns", name)
                up = f"link set {name} up"
                for command in (f"addr add {address} dev {name}", up, "link set lo up"):
                    run("ip", "-n", name, *command.split())
            thread = threading.Thread(target=self.carry)
            thread.start()
            self.push(undo.pop_all())
        self.callback(thread.join)
        self.callback(setattr, self, "is_open", False)

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
        chance = random.Random(1)
        ways = [Way(self.options), Way(self.options)]
        while self.is_open:
            next_due = min((way.waiting[0][0] for way in ways if way.waiting), default=math.inf)
            pause = min(max(next_due - time.monotonic(), 0.0), 0.1)
            for tap in select.select(self.taps, [], [], pause)[0]:
                frame, now = os.read(tap, 65536), time.monotonic()
                if not self.down_from <= now < self.down_until:
                    ways[self.taps.index(tap)].send(frame, now, chance)
            for way, to in zip(ways, reversed(self.taps)):
                while way.waiting and way.waiting[0][0] <= time.monotonic():
                    with contextlib.suppress(BlockingIOError):  # its queue is full
                        os.write(to, way.waiting.popleft()[1])


def run(*command):
    subprocess.run(command, check=True, capture_output=True)


def ticks_of(folder):
    """Each Tick of a recording."""
    names, ticks = [], []
    for topic, _, _, data, _ in mcap_messages.messages(next(folder.glob("*.mcap"))):
        if topic == "/palpate/session":
            names = data.decode(errors="replace").split('"tick_columns":[')[1].split("]")[0]
            names = [name.strip('"') for name in names.split(",")]
        elif topic == "/palpate/tick":
            numbers = dict(zip(names, struct.unpack(f"<{len(names)}d", data[-8 * len(names):])))
            ticks.append(Tick(*(numbers[name] for name in Tick._fields)))
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
    environment = dict(os.environ)
    if options.loopback:
        environment.update(ROS_LOCALHOST_ONLY="1", ROS_DOMAIN_ID=str(100 + os.getpid() % 100))
    at = [[] if options.loopback else ["ip", "netns", "exec", name] for name in SIDES]
    with contextlib.nullcontext() if options.loopback else Link(options) as link, \
            tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        path = folder / "press.csv"
        path.write_text("t,x,y,z\n0,0,0,0.05\n1,0,0,0.05\n2,0,0,%g\n%g,%g,0,%g\n" % (
            -DEPTH, options.seconds, 0.005 * (options.seconds - 2.0), -DEPTH))
        server = subprocess.Popen(
            at[0] + [program, "serve-camera", "--camera", options.camera, "--name", "far",
                     "--packing", options.packing],
            stderr=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
        hand = subprocess.Popen(
            at[1] + [program, "run", "--headless", "--json", "--duration", str(options.seconds),
                     "--record", folder / "session", "--device", f"script:{path}", "--camera",
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
    start = ticks[0].t
    up = start + (down_at + seconds if options.down else LANDING)
    if options.check:
        felt = sum(tick.force_z > LEAST_FELT for tick in ticks if tick.t > up)
        if felt < FELT_FOR or ticks[-1].frame_number < 10:
            sys.exit(f"poor_link: {ticks[-1].frame_number:.0f} images came, a force in {felt} "
                     "ticks since the link is up")
    pressed = [tick for tick in ticks if tick.t - start > LANDING]
    forces = [tick.force_z for tick in pressed]
    new = sorted(1e3 * tick.frame_age for before, tick in zip(pressed, pressed[1:])
                 if tick.frame_number > before.frame_number)
    ages = sorted(1e3 * tick.frame_age for tick in pressed)
    steps = [abs(b - a) for a, b in zip(forces, forces[1:])]
    usual = statistics.median(forces)
    frames = ((pressed[-1].frame_number - pressed[0].frame_number)
              / (pressed[-1].t - pressed[0].t))
    without = sum(force < 0.2 * usual for force in forces)
    later = (tick.t - up for tick in ticks if tick.t > up and tick.force_z > 0.8 * usual)
    back = f"{next(later, math.inf):.2f} s" if options.down else ""
    if sum(int(tick.safety) >> STALLED & 1 for tick in pressed):
        if options.table and again > 0:
            return measure(options, program, again - 1)
        print("poor_link: a busy machine: the session's own ticks came late", file=sys.stderr)
    return {"frames/s": f"{frames:.1f}", "age p50": f"{ages[len(ages) // 2]:.0f} ms",
            "p99": f"{ages[len(ages) * 99 // 100]:.0f} ms",
            "on arrival p50": f"{new[len(new) // 2]:.1f} ms",
            "p99 ": f"{new[len(new) * 99 // 100]:.1f} ms", "force": f"{usual:.2f} N",
            "largest step in 1 ms": f"{1e3 * max(steps):.0f} mN",
            "over 20 Hz": f"{1e3 * ripple(forces):.0f} mN", "without force": f"{without} ms",
            "back after": back}


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

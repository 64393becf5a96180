#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints what palpate costs as WebAssembly: size of build/site, ticks and frames against the
program's. `scripts/figures/site.py COST_OF_TICKS`, after scripts/site; COST_OF_TICKS is that of a
build with tests (tests/cost). For the browser: PALPATE_SITE_SPEED=1 web/browser/run site.

Native and Node run in turn, and the ratios are medians of those of each turn: on a machine under
other load these are valid. A tick is a mean over all, with its share of the frames at 30 Hz; a
frame is told from how much dearer ticks are with three times as many of them.
"""
import gzip
import resource
import statistics
import subprocess
import sys

from outcomes import ROOT, in_node

TURNS = 9
TICKS = 20000


def seconds(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def tick_and_frame(program, method):
    """[s] of a tick and of a frame, without the program's start."""
    def one(ticks_a_frame):
        few, many = (seconds(*program, str(ticks), method, "", str(ticks_a_frame))
                     for ticks in (TICKS // 10, TICKS))
        return (many - few) / (TICKS - TICKS // 10)
    seldom, often = one(33), one(11)
    return seldom, (often - seldom) / (1 / 11 - 1 / 33)


def main(native):
    size = sum(len(gzip.compress(file.read_bytes(), 9))
               for file in (ROOT / "build/site").iterdir() if file.is_file())
    print(f"build/site: {size} bytes, compressed by gzip")
    node = in_node("cost_of_ticks")
    for method in ("paper", "sight"):
        turns = [(tick_and_frame([native], method),
                  tick_and_frame(node, method)) for _ in range(TURNS)]
        for i, what in enumerate(("tick", "frame")):
            here, there = (statistics.median(place[i] for place in turn) for turn in zip(*turns))
            ratio = statistics.median(there[i] / here[i] for here, there in turns)
            print(f"{method}: {1e6 * here:.2f} us a {what} natively, {1e6 * there:.2f} us in "
                  f"Node.js, {ratio:.2f} times", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

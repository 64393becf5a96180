#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints what palpate costs as WebAssembly: size of build/site, ticks and frames against the
program's. `scripts/figures/site.py COST_OF_TICKS`, after scripts/site; COST_OF_TICKS is that of a
build with tests (tests/cost). For the browser: PALPATE_SITE_SPEED=1 web/browser/run site.

Native and Node run in turn, and the ratios are medians of those of each turn: on a machine under
other load these are valid. Means over all ticks, the frames at 30 Hz included, which are most of
what `sight` costs.
"""
import gzip
import pathlib
import resource
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TURNS = 9
TICKS = 20000


def seconds(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def tick(program, method, ticks):
    """[s] of a tick, without the program's start."""
    start = seconds(*program, str(ticks // 10), method)
    return (seconds(*program, str(ticks), method) - start) / (ticks - ticks // 10)


def main(native):
    size = sum(len(gzip.compress(file.read_bytes(), 9))
               for file in (ROOT / "build/site").iterdir() if file.is_file())
    print(f"build/site: {size} bytes, compressed by gzip")
    subprocess.run(["ninja", "-C", ROOT / "build/wasm", "cost_of_ticks"], check=True,
                   stdout=subprocess.DEVNULL)
    # With fetch() in Node, emscripten of 2022 takes it for a browser.
    node = ["node", "--no-experimental-fetch", str(ROOT / "build/wasm/cost_of_ticks.js")]
    for method in ("paper", "sight"):
        turns = [(tick([native], method, TICKS), tick(node, method, TICKS)) for _ in range(TURNS)]
        here, there = (statistics.median(turn) for turn in zip(*turns))
        ratio = statistics.median(there / here for here, there in turns)
        print(f"{method}: {1e6 * here:.2f} us a tick natively, {1e6 * there:.2f} us in Node.js, "
              f"{ratio:.2f} times")


if __name__ == "__main__":
    main(*sys.argv[1:])

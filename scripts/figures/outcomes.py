#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does every case of the bench come to the same in WebAssembly? `scripts/figures/outcomes.py
OUTCOMES [CASES]`, after scripts/site; OUTCOMES is the program of a build with tests
(`ninja outcomes`, tests/cost). Plays CASES of each family and class (1) natively and in Node.js and
compares the rows, in which all numbers have 17 digits. Some four minutes of building. Exits 1 if a
row differs.
"""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
METHODS = ("paper", "direct", "sight")


def in_node(program):
    """The command that runs a program of build/wasm, which is built for it."""
    # Debian's emscripten looks for its JavaScript where only Debian's node does.
    subprocess.run(["ninja", "-C", ROOT / "build/wasm", program], check=True,
                   stdout=subprocess.DEVNULL, env={**os.environ, "NODE_PATH": "/usr/share/nodejs"})
    # With fetch() in Node, emscripten of 2022 takes it for a browser.
    return ["node", "--no-experimental-fetch", str(ROOT / f"build/wasm/{program}.js")]


def main(native, cases="1"):
    node = in_node("outcomes")
    differ = 0
    for bench in ("pop", "field", "visits"):
        here, there = (subprocess.run([*program, bench, cases, *METHODS], check=True, text=True,
                                      capture_output=True).stdout.splitlines()
                       for program in ([native], node))
        unlike = [rows for rows in zip(here, there, strict=True) if rows[0] != rows[1]]
        differ += len(unlike)
        print(f"{bench}: {len(here)} rows, {len(unlike)} differ", flush=True)
        for rows in unlike[:3]:
            print(*rows, sep="\n")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

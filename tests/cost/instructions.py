#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does a tick execute about as many instructions as it did? `instructions.py PROGRAM`.

Valgrind counts them on a processor of its own, with AVX2 and without AVX-512, so that the figure
does not depend on the machine. 77: there is no valgrind.
"""
import re
import shutil
import subprocess
import sys

MOST = 8000  # a fifth more than the 6556 of g++ 12, with its 8 steps over 90 points


def instructions(program, ticks):
    result = subprocess.run(
        ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, str(ticks)],
        check=True, capture_output=True, text=True)
    return int(re.search(r"Collected : (\d+)", result.stderr).group(1)), int(result.stdout)


def main(program):
    if not shutil.which("valgrind"):
        print("skipped: this needs valgrind")
        return 77
    few, many = 500, 2500
    (start, steps_before), (end, steps_after) = (instructions(program, n) for n in (few, many))
    each = (end - start) / (many - few)
    steps = (steps_after - steps_before) / (many - few)
    print(f"{each:.0f} instructions and {steps:.2f} steps a tick, at most {MOST} instructions")
    return 0 if each <= MOST and steps > 1 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Has a fixed session the same ticks on aarch64, to the bit? `aarch64.py ROOT BUILD_FOLDER`.

Builds kernel and servo for it and runs them by qemu. 77: there is no cross compiler or no qemu.
"""
import pathlib
import shutil
import subprocess
import sys

NEEDED = {"aarch64-linux-gnu-g++": "g++-aarch64-linux-gnu", "qemu-aarch64": "qemu-user",
          "cmake": "cmake", "ninja": "ninja-build"}
# Optimised little where no loop asks for more, and room by room: what takes long is to parse Eigen.
OPTIONS = ["-DCMAKE_SYSTEM_NAME=Linux", "-DCMAKE_SYSTEM_PROCESSOR=aarch64",
           "-DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++", "-DCMAKE_CXX_FLAGS=-O1",
           "-DCMAKE_UNITY_BUILD=ON", "-DCMAKE_EXE_LINKER_FLAGS=-static"]


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}:\n{done.stdout}{done.stderr}")
    return done.stdout


def hashes(text):
    return dict(line.split() for line in text.splitlines() if not line.startswith("#"))


def main(root, build):
    for program, package in NEEDED.items():
        if not shutil.which(program):
            print(f"skipped: there is no {program}; apt-get install {package}")
            return 77
    run("cmake", "-S", f"{root}/site", "-B", build, "-G", "Ninja", *OPTIONS)
    run("ninja", "-C", build, "golden_ticks")
    here = hashes(run("qemu-aarch64", f"{build}/golden_ticks"))
    wanted = hashes(pathlib.Path(root, "tests/record/golden_hashes.txt").read_text())
    print(f"aarch64: {here}\nwanted:  {wanted}")
    return 0 if here == wanted else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

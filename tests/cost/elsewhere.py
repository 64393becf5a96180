#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Has a fixed session the same ticks elsewhere, to the bit? `elsewhere.py aarch64|wasm ROOT BUILD`.

Builds kernel and servo for it and runs them, by qemu or Node.js. 77: what that needs is not there.
"""
import os
import pathlib
import shutil
import subprocess
import sys

EMSCRIPTEN = "/usr/share/emscripten/cmake/Modules/Platform/Emscripten.cmake"
# Optimised little where no loop asks for more: what takes long is to parse Eigen.
PLACES = {
    "aarch64": {
        "needs": {"aarch64-linux-gnu-g++": "g++-aarch64-linux-gnu", "qemu-aarch64": "qemu-user"},
        "options": ["-DCMAKE_SYSTEM_NAME=Linux", "-DCMAKE_SYSTEM_PROCESSOR=aarch64",
                    "-DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc",
                    "-DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++", "-DCMAKE_CXX_FLAGS=-O1",
                    "-DCMAKE_EXE_LINKER_FLAGS=-static"],
        "run": ["qemu-aarch64", "golden_ticks"],
    },
    "wasm": {
        "needs": {"em++": "emscripten", "node": "nodejs"},
        "options": [f"-DCMAKE_TOOLCHAIN_FILE={EMSCRIPTEN}", "-DCMAKE_BUILD_TYPE=Release"],
        # With fetch() in Node, emscripten of 2022 takes it for a browser.
        "run": ["node", "--no-experimental-fetch", "golden_ticks.js"],
    },
}


def run(*command, folder=None):
    # Debian's emscripten looks for its JavaScript where only Debian's node does.
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder,
                          env={**os.environ, "NODE_PATH": "/usr/share/nodejs"})
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}:\n{done.stdout[-8000:]}{done.stderr[-8000:]}")
    return done.stdout


def hashes(text):
    return dict(line.split() for line in text.splitlines() if not line.startswith("#"))


def main(name, root, build):
    place = PLACES[name]
    for program, package in (place["needs"] | {"cmake": "cmake", "ninja": "ninja-build"}).items():
        if not shutil.which(program):
            print(f"skipped: there is no {program}; apt-get install {package}")
            return 77
    run("cmake", "-S", f"{root}/site", "-B", build, "-G", "Ninja", "-DCMAKE_UNITY_BUILD=ON",
        *place["options"])
    run("ninja", "-C", build, "-j", "2", "golden_ticks")  # as other tests run beside it
    here = hashes(run(*place["run"], folder=build))
    wanted = hashes(pathlib.Path(root, "tests/record/golden_hashes.txt").read_text())
    print(f"{name}: {here}\nwanted: {wanted}")
    return 0 if here == wanted else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

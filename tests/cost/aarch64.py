#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does the kernel compile for aarch64, with its loops as vector code? `aarch64.py ROOT EIGEN`.

77: there is no cross compiler (g++-aarch64-linux-gnu).
"""
import pathlib
import re
import shutil
import subprocess
import sys

# What a tick runs through.
SOURCES = ["palpate/kernel/core/patch_loops.cpp", "palpate/kernel/core/patch.cpp",
           "palpate/kernel/paper/proxy.cpp", "palpate/kernel/paper/paper.cpp",
           "palpate/kernel/cloud/depth_image.cpp",
           "palpate/kernel/cloud/point_cloud.cpp"]
COMPILER = "aarch64-linux-gnu-g++"
FLAGS = ["-std=c++20", "-O3", "-fopenmp-simd", "-fno-math-errno", "-fno-trapping-math", "-Wall",
         "-Wextra", "-Wno-restrict", "-Werror"]
LOOP_FLAGS = ["-fno-signed-zeros", "-fassociative-math", "-ffinite-math-only"]


def main(root, eigen):
    if not shutil.which(COMPILER):
        print(f"skipped: there is no {COMPILER}")
        return 77
    root = pathlib.Path(root)
    packed = {}
    for source in (root / name for name in SOURCES):
        flags = FLAGS + (LOOP_FLAGS if source.stem in ("patch_loops", "proxy") else [])
        code = subprocess.run([COMPILER, *flags, f"-I{root}", "-isystem", eigen, "-S", "-o", "-",
                               str(source)], capture_output=True, text=True)
        if code.returncode != 0:
            print(code.stderr)
            return 1
        packed[source.stem] = len(re.findall(r"\bv\d+\.4s", code.stdout))
    print(packed)
    return 0 if min(packed["patch_loops"], packed["proxy"], packed["depth_image"]) > 30 else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

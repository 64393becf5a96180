#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Are the kernel's loops vector code, for each set? `vector_code.py LIBRARY...`; 77: unknown."""
import platform
import re
import shutil
import subprocess
import sys

LOOPS = {"move": "sqrtps", "travel": "sqrtps", "escape": "sqrtps", "deproject_pixels": "cvtdq2ps",
         "raise": "mulps"}  # gcc 14 divides point by point there
REGISTERS = {"any": "xmm", "avx2": "ymm", "avx512": "zmm"}
LEAST = 12  # packed operations on the widest registers in a loop


def main(libraries):
    if platform.machine() != "x86_64" or not shutil.which("objdump"):
        print("skipped: this needs objdump, on x86-64")
        return 77
    bodies = {}
    for library in libraries:
        text = subprocess.run(["objdump", "-d", "--no-show-raw-insn", library], check=True,
                              capture_output=True, text=True).stdout
        for match in re.finditer(r"^[0-9a-f]+ <(\S+)>:\n((?:.+\n)+)", text, re.M):
            name = re.search(r"Vectorised.*_GLOBAL__N_1\d+([a-z_]+)E.*\don_([a-z0-9]+)E",
                             match.group(1))
            if name:
                bodies[name.groups()] = match.group(2)
    faults = []
    for loop, needed in LOOPS.items():
        for vector_set, register in REGISTERS.items():
            body = bodies.get((loop, vector_set))
            if body is None:
                faults.append(f"{loop}: there is no code of it for {vector_set}")
                continue
            packed = len(re.findall(rf"\sv?\w+ps\s.*%{register}", body))
            print(f"{loop}, {vector_set}: {packed} packed operations on {register}")
            if packed < LEAST:
                faults.append(f"{loop}: its code for {vector_set} is not vector code")
            if not re.search(rf"\bv?{needed}\s.*%{register}", body):
                faults.append(f"{loop}: its code for {vector_set} has no {needed} on {register}")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Presses every file and sequence of a data folder, and of a set that it makes, at five pixels.

    scripts/figures/pressed.py PROGRAM DATA [--only WORD]

Prints a table in Markdown: of each press the ticks with more than 1 N, or what the program said;
and the ticks a second of all five, on one core and with the program's start. A press is felt with
100 such ticks or more. Exit status 1: some press is neither felt nor told why.
"""

import argparse
import csv
import math
import random
import re
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FELT = 100  # [ticks] of more than 1 N
LONGEST = 120  # [s] of one press
IMAGE = (640, 480)  # [px] where the program does not say


def write_pcd(path: Path, points, width=None, colours=None) -> None:
    """Binary PCD; `width` makes it organised."""
    fields, kinds = ("x y z rgb", "F F F U") if colours else ("x y z", "F F F")
    count = len(points)
    columns = width or count
    header = (
        f"VERSION 0.7\nFIELDS {fields}\nSIZE {'4 ' * len(fields.split())}\nTYPE {kinds}\n"
        f"COUNT {'1 ' * len(fields.split())}\nWIDTH {columns}\nHEIGHT {count // columns}\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n"
    )
    with path.open("wb") as file:
        file.write(header.encode())
        for i, point in enumerate(points):
            file.write(struct.pack("<3f", *point))
            if colours:
                file.write(struct.pack("<I", colours[i]))


def sheet(count: int, side: float, distance: float, dice: random.Random):
    """Points of a slightly curved sheet before a camera [m]."""
    points = []
    for _ in range(count):
        x, y = dice.uniform(-side, side), dice.uniform(-side, side)
        points.append((x, y, distance + 0.1 * (x * x + y * y) / side))
    return points


def made(folder: Path) -> list[str]:
    dice = random.Random(34)
    grid = []
    for v in range(240):
        for u in range(320):
            z = 0.8 + 0.1 * math.sin(0.03 * u) if dice.random() > 0.3 else math.nan
            grid.append(((u - 159.5) / 262 * z, (v - 119.5) / 262 * z, z))
    metres = sheet(40_000, 0.3, 0.8, dice)
    files = {
        "one_metre.pcd": (metres,),
        "millimetres.pcd": ([tuple(1e3 * c for c in p) for p in metres],),
        "organised_nan.pcd": (grid, 320),
        "million.pcd": (sheet(1_000_000, 1.0, 2.0, dice),),
        "thin.pcd": ([(dice.gauss(0, 5e-4), y / 4000 - 0.25, 0.8) for _, y in
                      ((0, i) for i in range(2000))],),
        "sparse.pcd": (sheet(400, 0.3, 0.8, dice),),
        "coloured.pcd": (metres, None, [dice.randrange(1 << 24) for _ in metres]),
    }
    for name, arguments in files.items():
        write_pcd(folder / name, *arguments)
    return [f"pcd:{folder / name}" for name in files]


def found(data: Path) -> list[str]:
    """What of a folder the program can open."""
    uris = []
    for folder in sorted({p.parent for p in data.rglob("*") if p.is_file()}):
        if (folder / "depth.txt").exists():
            uris += [f"tum:{folder}", f"tum:{folder}?poses=none"]
        elif (folder / "intrinsics.json").exists():
            uris.append(f"depth:{folder}")
        for kind in ("pcd", "ply"):
            files = sorted(folder.glob(f"*.{kind}"))
            uris += [f"{kind}:{file}" for file in files]
        uris += [f"recording:{f}" for end in ("bag", "mcap", "db3")
                 for f in sorted(folder.glob(f"*.{end}"))]
    return uris


def press(program: str, uri: str, pixel: tuple[int, int], out: Path):
    """Ticks, ticks above 1 N, seconds, and what was said."""
    out.unlink(missing_ok=True)
    began = time.monotonic()
    command = [program, "trace", "--camera", uri, "--press", f"{pixel[0]},{pixel[1]}", "--out", out]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        return 0, 0, LONGEST, "it took too long"
    seconds = time.monotonic() - began
    ticks = felt = 0
    if done.returncode == 0:
        with out.open(newline="") as file:
            for row in csv.DictReader(file):
                ticks += 1
                felt += math.hypot(*(float(row[f"force_{axis}"]) for axis in "xyz")) > 1.0
    # Which pixel was pressed instead, and when frames ended, are no reasons.
    said = [line.removeprefix("palpate: ") for line in done.stderr.splitlines()
            if "the nearest one that has" not in line and "its frames ended" not in line]
    return ticks, felt, seconds, said[-1] if said else ""


def size_of(program: str, uri: str) -> tuple[int, int] | None:
    """Of its image [px]; none: it cannot be opened."""
    done = subprocess.run([program, "info", uri], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return None
    image = re.search(r"^ *image: (\d+)x(\d+)$", done.stdout, re.MULTILINE)
    is_image = image and "focal_length_px" in done.stdout
    return (int(image[1]), int(image[2])) if is_image else IMAGE


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", default="", help="only what has this in its URI")
    options = parser.parse_args()
    places = ((0.5, 0.5), (0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75))
    unexplained = presses = felt_presses = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("| file | ticks with more than 1 N, at five pixels | ticks/s | what is said |")
        print("|---|---|---|---|")
        for uri in found(options.data) + made(folder):
            if options.only not in uri:
                continue
            size = size_of(options.program, uri)
            if size is None:
                continue
            results = [
                press(options.program, uri, (int(x * size[0]), int(y * size[1])), folder / "t.csv")
                for x, y in places
            ]
            silent = sum(felt < FELT and not said for _, felt, _, said in results)
            unexplained += silent
            presses += len(results)
            felt_presses += sum(felt >= FELT for _, felt, _, _ in results)
            rate = sum(r[0] for r in results) / max(sum(r[2] for r in results), 1e-9)
            why = dict.fromkeys(said for _, felt, _, said in results if felt < FELT)
            scheme, _, path = uri.partition(":")
            for root in (options.data, folder):
                path = path.removeprefix(f"{root}/")
            print(f"| `{scheme}:{path}` | {', '.join(str(r[1]) for r in results)} | {rate:.0f} "
                  f"| {'; '.join(w or 'nothing' for w in why)} |"
                  .replace(str(folder), ""), flush=True)
    print(f"{felt_presses} of {presses} presses are felt, {unexplained} are neither felt nor told "
          "why", file=sys.stderr)
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures this machine and writes docs/performance.md and docs/images/growth.svg.

  scripts/figures/performance.py BUILD [RESULTS]
    BUILD    a Release build with tests, made without ccache
    RESULTS  folder with bench.json, sight.json and growth.csv of an earlier run, to be drawn again
"""
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def kernel_table(scenes):
    lines = ["| scene | points | steps a tick | step | gather | tick | p99 | p99.9 | max | frame() "
             "| limit | tick / limit |", "|---|" + "---:|" * 11]
    for scene in scenes:
        k = scene["kernel"]
        tick = k["tick"]
        lines.append(
            f"| {scene['name']} | {k['points_per_patch']:.0f} | {k['steps_per_tick']:.1f} "
            f"| {k['step']['median_us']:.3f} | {k['gather']['median_us']:.2f} "
            f"| {tick['median_us']:.2f} | {tick['p99_us']:.1f} | {tick['p999_us']:.1f} "
            f"| {tick['max_us']:.0f} | {k['frame']['median_us']:.4f} | {k['limit_tick_us']:.3f} "
            f"| {k['tick_over_limit']:.1f} |")
    return "\n".join(lines)


def search_table(scenes):
    names = [row["method"] for row in scenes[0]["search"]]
    lines = ["| scene | found | " + " | ".join(names) + " |", "|---|---:|" + "---:|" * len(names)]
    for scene in scenes:
        cells = []
        for row in scene["search"]:
            build = f"{row['build']['median_us'] / 1e3:.1f} ms + " if row["build"] else ""
            cells.append(f"{build}{row['query']['median_us']:.2f}")
        lines.append(f"| {scene['name']} | {scene['search'][0]['found']} | "
                     + " | ".join(cells) + " |")
    return "\n".join(lines)


def sight_table(scenes):
    lines = ["| scene | tick | p99 | p99.9 | frame() |", "|---|" + "---:|" * 4]
    for scene in scenes:
        k = scene["kernel"]
        tick = k["tick"]
        lines.append(f"| {scene['name']} | {tick['median_us']:.2f} | {tick['p99_us']:.1f} "
                     f"| {tick['p999_us']:.1f} | {k['frame']['median_us']:.1f} |")
    return "\n".join(lines)


def build_times(build):
    """Seconds each folder's files took to compile, and the five longest, from ninja's own log."""
    folders, files = {}, {}
    for line in (build / ".ninja_log").read_text().splitlines()[1:]:
        begin, end, _, output, _ = line.split("\t")
        if output.endswith(".o"):
            name = output.replace("CMakeFiles/", "").removesuffix(".o")
            files[name] = (int(end) - int(begin)) / 1e3
    for name, seconds in files.items():
        top = name.split("/")[0]
        folders[top] = folders.get(top, 0.0) + seconds
    slowest = sorted(files, key=files.get, reverse=True)[:5]
    return (", ".join(f"`{top}` {folders[top]:.0f} s" for top in sorted(folders)),
            ", ".join(f"`{name.split('/')[-1]}` {files[name]:.0f} s" for name in slowest))


def growth_table(rows):
    lines = ["| series | x | points | steps | tick | build |", "|---|" + "---:|" * 5]
    for r in rows:
        build = f"{float(r['build_us']) / 1e3:.1f} ms" if float(r["build_us"]) else "–"
        lines.append(f"| {r['series']} | {float(r['x']):g} | {float(r['points']):.0f} "
                     f"| {float(r['steps']):.1f} | {float(r['tick_us']):.2f} "
                     f"| {build} |")
    return "\n".join(lines)


def size_of(path):
    return path.stat().st_size if path.is_file() else \
        sum(f.stat().st_size for f in path.rglob("*") if f.is_file())


def page(result, sight, rows, build, installed):
    by_name = {scene["name"]: scene for scene in result["scenes"]}
    one_metre = by_name["640x480 at 1 m"]
    query = {row["method"]: row["query"]["median_us"] for row in one_metre["search"]}
    ours, tree = query["depth image"], query["nanoflann"]
    pcl = [name for name in query if name.startswith("PCL")]
    ratios = ", ".join(f"{name}'s {query[name] / ours:.1f}"
                       for name in ["nanoflann", "voxel hash", *pcl, "brute force"])
    program = build / "app/palpate"
    folders, slowest = build_times(build)
    tick = result["tick_us_median"]
    return f"""# What a tick costs

Made by `scripts/figures/performance.py`: do not edit, run it again. Times are microseconds of the
thread's own processor time. Ticks are timed one by one, what is shorter in batches of 64. A noisy
plane (1 mm, readings in millimetres) is pressed 5 mm deep and stroked at 0.1 m/s; Table 2's
parameters; frames at 30 Hz, ticks at 1 kHz.

Machine: {result['processor']}, {os.cpu_count()} cores, loops in {result['vector_set']}. It is a
virtual machine that others were using at the same time: medians and ratios hold, maxima are theirs.

```
palpate bench --json >bench.json
palpate bench --method sight --json >sight.json
palpate bench --growth --out .
```

## The kernel

{kernel_table(result['scenes'])}

*limit* is a loop that only loads and adds the same points, as often as the tick looks around, and
the same pixels, as often as it gathers. It counts neither the roots and quotients of equations (2)
and (9) nor the second look that a step in free motion or out of entrenchment takes. Nor does it
wait: its passes run into one another, where a step begins with what the one before has found, sums,
quotient and all. The fewer the points, the more of a tick is that wait. The aim was a tick within
three times the limit; it is missed: the last column says by how much.

### Sight

The same with `--method sight`, whose work is done when a frame is handed over, on the thread that
ticks; most ticks then only follow the fitted surface, and some (p99) fit it anew.

{sight_table(sight['scenes'])}

## Beside what one could use instead

One ball of 11 mm on the same frame: what has to be built for each frame, and the query.

{search_table(result['scenes'])}

Queries at 1 m in units of our gather: {ratios}; and we have nothing to build. The trees are
given their points, where a depth camera gives none; PCL's organised search, which needs no tree,
needs the whole image deprojected.
A whole tick, with its {one_metre['kernel']['steps_per_tick']:.1f} steps, takes
{tick / tree:.1f} times one nanoflann query. Handing a frame over takes
{1e3 * result['frame_us_median']:.1f} ns; building the tree takes
{result['kdtree_build_us_median'] / 1e3:.0f} ms, more than there is between two frames at 30 Hz.
{'' if pcl else "PCL was not installed where this was made." + chr(10)}
## How it grows

![Ticks against what might make them grow](images/growth.svg)

Flat in the size of the image, the frame rate and the size of an unorganised cloud; linear in the
points of the patch, hence in the cameras that see it. *build* of an unorganised cloud includes
making its points up, and is paid on the camera's thread.

{growth_table(rows)}

## Memory and size

The process held {result['resident_bytes'] / 2**20:.0f} MiB after all of `palpate bench`, frames,
trees and samples included. From a first to a second session, once warm, it grew by
{result['resident_growth_bytes'] / 1024:.0f} KiB, samples of the measurement included; a tick does
not allocate (`tests/core`). The program is {size_of(program) / 2**20:.1f} MiB, all
that is installed
{size_of(installed) / 2**20:.1f} MiB.

Compiling for Release with tests, one core's seconds by folder: {folders}. The longest files:
{slowest}. Two cores share them; templates (Eigen's, Boost's, nanoflann's) take most of it.

## What the tests hold fast

`tests/cost`: each loop's clone for SSE2, AVX2 and AVX-512 is disassembled and must be vector code
of that width; all three agree on the same points, on single lengths to 5 nm and on sums of unit
vectors to 2e-5; a slide's steps and gathers have bounds; so have the instructions of a
tick, counted by
valgrind (6408 when the bound was set, with 8.3 steps over 90 points on AVX2); the kernel compiles
for aarch64 where there is a cross compiler.
"""


def main(build, results=None):
    build = pathlib.Path(build).resolve()
    program = build / "app/palpate"
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(results or work)
        if results is None:
            out = subprocess.run([program, "bench", "--json"], check=True, capture_output=True)
            (folder / "bench.json").write_bytes(out.stdout)
            out = subprocess.run([program, "bench", "--method", "sight", "--json"], check=True,
                                 capture_output=True)
            (folder / "sight.json").write_bytes(out.stdout)
            subprocess.run([program, "bench", "--growth", "--out", folder], check=True)
        result = json.loads((folder / "bench.json").read_text())
        sight = json.loads((folder / "sight.json").read_text())
        with open(folder / "growth.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        installed = pathlib.Path(work) / "installed"
        subprocess.run(["cmake", "--install", build, "--prefix", installed], check=True,
                       stdout=subprocess.DEVNULL)
        subprocess.run([program, "eval", "--draw", folder / "growth.csv"], check=True)
        shutil.copy(folder / "growth.svg", ROOT / "docs/images")
        (ROOT / "docs/performance.md").write_text(page(result, sight, rows, build,
                                                                 installed))


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("performance: give a Release build, and a folder of results to draw them again")
    main(*sys.argv[1:])

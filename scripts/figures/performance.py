#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures this machine and writes docs/performance.md and docs/images/growth.svg.

  scripts/figures/performance.py BUILD [RESULTS]
    BUILD    a Release build
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
    lines = ["| scene | points | steps per tick | step | gather | tick | p99 | p99.9 | max "
             "| frame() |", "|---|" + "---:|" * 9]
    for scene in scenes:
        k = scene["kernel"]
        tick = k["tick"]
        lines.append(
            f"| {scene['name']} | {k['points_per_patch']:.0f} | {k['steps_per_tick']:.1f} "
            f"| {k['step']['median_us']:.3f} | {k['gather']['median_us']:.2f} "
            f"| {tick['median_us']:.2f} | {tick['p99_us']:.1f} | {tick['p999_us']:.1f} "
            f"| {tick['max_us']:.0f} | {k['frame']['median_us']:.4f} |")
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
    tick = result["tick_us_median"]
    return f"""# Performance

Made by `scripts/figures/performance.py`: do not edit, run it again. Times are microseconds of the
thread's own processor time. Ticks are timed one by one, shorter parts in batches of 64. The HIP
presses 5 mm deep into a noisy plane (1 mm, units of millimetres) and slides at 0.1 m/s; parameters
of Table 2; frames at 30 Hz, ticks at 1 kHz.

Machine: {result['processor']}, {os.cpu_count()} cores, loops in {result['vector_set']}. It is a
virtual machine under other load: medians and ratios are valid, maxima are due to that load.

```
palpate bench --json >bench.json
palpate bench --method sight --json >sight.json
palpate bench --growth --out .
```

## Time per tick, `paper`

{kernel_table(result['scenes'])}

### Sight

The same with `--method sight`, which works mainly when a frame arrives, in the servo thread; most
ticks then only follow the fitted surface, and some (p99) repeat the fit.

{sight_table(sight['scenes'])}

## Compared with alternatives

One sphere of 11 mm in the same frame: time to build the structure for each frame, and to query
it.

{search_table(result['scenes'])}

Queries at 1 m in units of our gather: {ratios}; the depth image needs no building. The trees
get points, but a depth camera gives an image; PCL's organised search needs no tree, but the whole
image must be deprojected.
A whole tick, with its {one_metre['kernel']['steps_per_tick']:.1f} steps, takes
{tick / tree:.1f} times one nanoflann query. Passing a frame on takes
{1e3 * result['frame_us_median']:.1f} ns; building the tree takes
{result['kdtree_build_us_median'] / 1e3:.0f} ms, more than there is between two frames at 30 Hz.
{'' if pcl else "PCL was not installed where this was made." + chr(10)}
## Scaling

![Time per tick against possible influences](images/growth.svg)

Constant in the image size, the frame rate and the size of an unorganised cloud; linear in the
points of the patch, hence in the number of cameras that see it. *build* of an unorganised cloud
includes generating its points, and runs in the camera thread.

{growth_table(rows)}

## Memory and size

The process held {result['resident_bytes'] / 2**20:.0f} MiB after all of `palpate bench`, frames,
trees and samples included. From a first to a second session, once warm, it grew by
{result['resident_growth_bytes'] / 1024:.0f} KiB, including samples of the measurement; a tick does
not allocate (`tests/core`). The program is {size_of(program) / 2**20:.1f} MiB, all
that is installed
{size_of(installed) / 2**20:.1f} MiB.

## Guaranteed by tests

`tests/cost`: the versions of each loop for SSE2, AVX2 and AVX-512 are disassembled and must be
vector code of that width, and all three give the same points, lengths and sums, bit for bit; the
steps and gathers of a slide are bounded, and so are the instructions of a
tick, counted by valgrind (6408 when the bound was set, with 8.3 steps over 90 points on AVX2);
kernel and servo, built for aarch64 and run by qemu, and as WebAssembly run by Node.js, give the
golden hashes, where g++-aarch64-linux-gnu and qemu-user, or emscripten, are installed.
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
        subprocess.run([sys.executable, ROOT / "python/palpate/figures.py", folder / "growth.csv"],
                       check=True)
        shutil.copy(folder / "growth.svg", ROOT / "docs/images")
        (ROOT / "docs/performance.md").write_text(page(result, sight, rows, build,
                                                                 installed))


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("performance: give a Release build, and a folder of results to draw them again")
    main(*sys.argv[1:])

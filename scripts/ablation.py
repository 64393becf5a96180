#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is each part of sight worth? Plays the bench without it: the variants of lab/ablation.txt.

scripts/ablation.py BUILD [--cases N] [--seed N] [NUMBER | FIRST-LAST]...
  BUILD        a build folder with an up-to-date palpate-lab, such as build/test/gcc
  --cases N    of each family of `eval pop`, 5 without
  --seed N     from which its cases are drawn, 3 without: no constant was chosen on these
  NUMBER       variants to play, such as 3 7-12; all without

All variants are compiled into a copy of the sources at once, each behind a switch that an
environment variable sets. Prints a table for docs/sight.md: the share of cases held and right, the
families that lose most against the whole method, and how many aims of `eval fidelity` are met.
"""
import argparse
import concurrent.futures
import csv
import os
import pathlib
import subprocess
import sys
import tempfile

import variants

LIST = variants.ROOT / "lab/ablation.txt"
FLAGS = ("-O3", "-fopenmp-simd")


def rows_of(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def play(program, number, cases, seed, scratch):
    """({family: (held, right)} in per cent, aims of fidelity met)."""
    out = scratch / f"out-{number}"
    environment = {**os.environ, variants.VARIABLE: str(number)}
    for arguments in (["pop", "--cases", str(cases), "--seed", str(seed)], ["fidelity"]):
        run = subprocess.run([program, "eval", *arguments, "--methods", "sight", "--jobs", "1",
                              "--out", out], env=environment, capture_output=True, text=True)
        if run.returncode != 0:
            sys.exit(f"ablation: variant {number}: eval {arguments[0]} failed:\n{run.stderr}")
    families = {}
    for row in rows_of(out / "pop.csv"):
        held, right, count = families.get(row["family"], (0, 0, 0))
        n = int(row["cases"])
        families[row["family"]] = (held + n - int(row["lost"]), right + float(row["right"]),
                                   count + n)
    shares = {f: (100.0 * h / n, 100.0 * r / n) for f, (h, r, n) in families.items()}
    met = sum(float(row["value"]) <= float(row["aim"]) for row in rows_of(out / "fidelity.csv")
              if row["aim"] not in ("", "-"))
    return shares, met


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def line_of(name, shares, met, whole):
    losses = sorted((whole[f][0] - shares[f][0], f) for f in shares)[::-1]
    worst = ", ".join(f"{f} −{loss:.0f}" for loss, f in losses[:3] if loss > 0.0)
    return (f"| {name} | {mean(h for h, _ in shares.values()):.1f} | "
            f"{mean(r for _, r in shares.values()):.1f} | {worst or '–'} | {met} |")


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("build", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("numbers", nargs="*")
    parser.add_argument("--cases", type=int, default=5)
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    listed = variants.read_list(LIST)
    unnamed = [v.text for v in listed if not v.note]
    if unnamed:
        sys.exit(f"ablation: {LIST}: {unnamed[0]}: a name belongs behind ' # '")
    chosen = variants.numbers_of(options.numbers, len(listed)) or set(range(1, len(listed) + 1))
    print("| variant | held [%] | right [%] | families that lose most [points] | "
          "aims of fidelity |\n|---|---|---|---|---|", flush=True)
    whole = None
    with tempfile.TemporaryDirectory() as name:
        for i, batch in enumerate(variants.batches(listed)):
            numbers = sorted(chosen & {n for piece in batch for n, _ in piece.variants})
            if not numbers:
                continue
            scratch = pathlib.Path(name) / str(i)
            scratch.mkdir()
            program = variants.build(batch, options.build, scratch, "app/palpate-lab", FLAGS)
            if whole is None:
                whole, met = play(program, 0, options.cases, options.seed, scratch)
                print(line_of("whole", whole, met, whole), flush=True)
            with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
                results = [(n, workers.submit(play, program, n, options.cases, options.seed,
                                              scratch)) for n in numbers]
                for number, result in results:
                    print(line_of(listed[number - 1].note, *result.result(), whole), flush=True)


if __name__ == "__main__":
    main()

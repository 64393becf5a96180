#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Do the tests of a room notice a fault? Puts in each mutant of tests/servo/mutants.txt.

scripts/mutants.py BUILD [NUMBER | FIRST-LAST]...
  BUILD        a build folder with up-to-date tests of these rooms, such as build/test/gcc
  NUMBER       mutants to try, such as 12 33 274-293; all without

All mutants are compiled into a copy of the sources at once, each behind a switch that an
environment variable sets, so a mutant costs a run of the tests and no build. The likeliest tests to
notice it come first. Prints a verdict on each; exits 1 if fewer than 95 % of those that are not
equivalent are noticed.
"""
import concurrent.futures
import itertools
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import variants

LIST = variants.ROOT / "tests/servo/mutants.txt"
PROGRAMS = {"palpate/kernel/tool": "tests/tool/test_tool",
            "palpate/drivers": "tests/drivers/test_drivers"}
SLOW = ("Adversary.*:EnergyLink.LetsHonest*:EnergyLink.StopsEvery*:Cycle.FindsNoFault*:"
        "SafetyChain.KeepsItsBounds*:*Loop.Disables*:*Loop.Stops*:ServoLoop.TicksWhile*:"
        "DrivenLoop.RefusesADevice*")
NEAR = {"safety": "Safety*", "freshness": "Freshness*", "energy_monitor": "Energy*",
        "cycle": "Cycle*:DeviceFault*", "free_side": "FreeSide*", "workspace": "Cycle*:Clutch*",
        "force_watchdog": "ForceWatchdog*", "servo_loop": "*Loop.*",
        "last_gate": "LastGate*:Cycle*"}


def program_of(file):
    return PROGRAMS.get(str(pathlib.Path(file).parent), "tests/servo/test_servo")


def stages(file):
    """Filters of tests: the likeliest to notice a mutant of `file` first, the slow ones last."""
    if str(pathlib.Path(file).parent) in PROGRAMS:
        return ["*" if "tool" in file else "ForceDimension*"]
    near = NEAR.get(pathlib.Path(file).stem)
    return ([f"{near}-{SLOW}"] if near else []) + [f"-{SLOW}", SLOW]


def run_tests(program, number, tests, limit):
    environment = dict(os.environ, GTEST_FAIL_FAST="1")
    environment[variants.VARIABLE] = str(number)
    return subprocess.run([program, f"--gtest_filter={tests}"], env=environment, timeout=limit,
                          capture_output=True, text=True, errors="replace")


def time_limits(program, files):
    """{filter: [s]} after which a mutant hangs: ten times what the tests take without any."""
    limits = {}
    for tests in sorted({t for file in files for t in stages(file)}):
        began = time.time()
        run = run_tests(program, 0, tests, None)
        if run.returncode != 0:
            sys.exit(f"mutants: the tests fail without any:\n{run.stdout[-2000:]}")
        limits[tests] = 10.0 + 10.0 * (time.time() - began)
    return limits


def noticed(program, number, file, limits):
    """The test that fails first, or None."""
    for tests in stages(file):
        try:
            run = run_tests(program, number, tests, limits[tests])
        except subprocess.TimeoutExpired:
            return "it hangs"
        if run.returncode != 0:
            failed = re.search(r"\[  FAILED  \] (\S+)", run.stdout)
            return failed.group(1) if failed else f"it ends with {run.returncode}"
    return None


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    build_folder = pathlib.Path(sys.argv[1]).resolve()
    mutants = variants.read_list(LIST)
    if any(m.marked and not m.note for m in mutants):
        sys.exit(f"mutants: {LIST}: an equivalent mutant needs a reason behind ' # '")
    chosen = variants.numbers_of(sys.argv[2:], len(mutants))
    survivors, killed, began = [], 0, time.time()
    with tempfile.TemporaryDirectory() as scratch:
        groups = itertools.product(variants.batches(mutants), ["", *PROGRAMS])
        for i, (batch, room) in enumerate(groups):
            target = PROGRAMS.get(room, program_of(""))
            batch = [piece for piece in batch if program_of(piece.file) == target]
            numbers = [n for piece in batch for n, _ in piece.variants if not chosen or n in chosen]
            if not numbers:
                continue
            files = {mutants[number - 1].file for number in numbers}
            batch = [piece for piece in batch if piece.file in files]
            folder = pathlib.Path(scratch) / str(i)
            folder.mkdir()
            program = variants.build(batch, build_folder, folder, target)
            limits = time_limits(program, files)
            with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
                tried = [(n, workers.submit(noticed, program, n, mutants[n - 1].file, limits))
                         for n in sorted(numbers)]
                for number, result in tried:
                    mutant = mutants[number - 1]
                    by = result.result()
                    killed += by is not None and not mutant.marked
                    if by is None and not mutant.marked:
                        survivors.append(number)
                    verdict = ("survives" if by is None else "noticed") if not mutant.marked else (
                        "equivalent" if by is None else "not equivalent")
                    print(f"{verdict}: {number} {mutant.file}: {mutant.original} => {mutant.text}" +
                          (f": {by}" if by else ""), flush=True)
    equivalent = sum(m.marked for n, m in enumerate(mutants, 1)
                     if not chosen or n in chosen)
    total = killed + len(survivors)
    print(f"{total + equivalent} mutants, {equivalent} equivalent, {killed} of {total} noticed "
          f"({100.0 * killed / max(total, 1):.1f} %) in {time.time() - began:.0f} s")
    sys.exit(0 if killed >= 0.95 * total else 1)


if __name__ == "__main__":
    main()

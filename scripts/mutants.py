#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Do the tests of the servo room notice a fault? Puts in each mutant of tests/servo/mutants.txt.

scripts/mutants.py BUILD [NUMBER | FIRST-LAST]...
  BUILD        a build folder with an up-to-date test_servo, such as build/test/gcc
  NUMBER       mutants to try, such as 12 33 274-293; all without

All mutants are compiled into a copy of the sources at once, each behind a switch that an
environment variable sets, so a mutant costs a run of the tests and no build. The likeliest tests to
notice it come first. Prints a verdict on each; exits 1 if fewer than 95 % of those that are not
equivalent are noticed.
"""
import concurrent.futures
import functools
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
LIST = ROOT / "tests/servo/mutants.txt"
SLOW = ("Adversary.*:EnergyLink.LetsHonest*:EnergyLink.StopsEvery*:Cycle.FindsNoFault*:"
        "SafetyChain.KeepsItsBounds*:*Loop.Disables*:*Loop.Stops*:ServoLoop.TicksWhile*:"
        "DrivenLoop.RefusesADevice*")
NEAR = {"safety": "Safety*", "freshness": "Freshness*", "energy_monitor": "Energy*",
        "cycle": "Cycle*:DeviceFault*", "free_side": "FreeSide*", "workspace": "Cycle*:Clutch*",
        "force_watchdog": "ForceWatchdog*", "servo_loop": "*Loop.*"}
SWITCH = """#pragma once
#include <cstdlib>
inline int palpate_mutant() {
  static const char* const text = std::getenv("PALPATE_MUTANT");
  static const int number = text ? std::atoi(text) : 0;
  return number;
}
"""


def read_list():
    """[(file, original, type, occurrence, mutant, reason or None)], numbered from 1 by position."""
    mutants, file, original = [], None, None
    for line in LIST.read_text().splitlines():
        if not line or line.startswith("#"):
            continue
        if line.startswith("@ "):
            file = line[2:]
        elif line.startswith("=> "):
            mutants.append((file, *original, line[3:], None))
        elif line.startswith("=~ "):
            mutant, _, reason = line[3:].rpartition(" # ")
            if not mutant:
                sys.exit(f"mutants: {line}: an equivalent mutant needs a reason behind ' # '")
            mutants.append((file, *original, mutant.strip(), reason))
        else:
            kind, text, nth = re.fullmatch(r"(?:\[(\w+)\] )?(.*?)(?: @(\d+))?", line).groups()
            original = (text, kind, int(nth) if nth else None)
    return mutants


@functools.cache
def source_of(file):
    return (ROOT / file).read_text()


def position(source, file, text, nth):
    places = [m.start() for m in re.finditer(re.escape(text), source)]
    if nth is None and len(places) != 1 or nth is not None and len(places) < nth:
        sys.exit(f"mutants: {file}: '{text}' is there {len(places)} times; say which by ' @N'")
    return places[(nth or 1) - 1]


def switched(original, kind, variants):
    """The original with its mutants behind switches. variants: [(number, mutant)]."""
    if original.startswith("constexpr "):
        head, _, value = original.partition(" = ")
        for number, mutant in variants:
            value = f"palpate_mutant() == {number} ? {mutant.partition(' = ')[2]} : {value}"
        return head.replace("constexpr", "const") + " = " + value
    if original.endswith(";"):
        chain = "".join(f"if (palpate_mutant() == {n}) {{ {m} }} else " for n, m in variants)
        return f"{{ {chain}{{ {original} }} }}"
    wrap = kind or ""
    result = f"{wrap}({original})"
    for number, mutant in variants:
        result = f"(palpate_mutant() == {number} ? {wrap}({mutant}) : {result})"
    return result


def groups(mutants):
    """Mutants of the same piece belong together; pieces that overlap go into different batches."""
    pieces = {}
    for number, (file, text, kind, nth, mutant, _) in enumerate(mutants, 1):
        source = source_of(file)
        at = position(source, file, text, nth)
        pieces.setdefault((file, at, text, kind), []).append((number, mutant))
    batches = []
    for (file, at, text, kind), variants in sorted(pieces.items(), key=lambda p: p[0][:3]):
        for batch in batches:
            if all(f != file or at + len(text) <= a or a + len(t) <= at for f, a, t, _, _ in batch):
                batch.append((file, at, text, kind, variants))
                break
        else:
            batches.append([(file, at, text, kind, variants)])
    return batches


def build(batch, build_folder, folder):
    """Links test_servo with the mutated sources before the libraries. @return the program."""
    (folder / "switch.hpp").write_text(SWITCH)
    objects = []
    for file in sorted({piece[0] for piece in batch}):
        source = source_of(file)
        for _, at, text, kind, variants in sorted((p for p in batch if p[0] == file),
                                                  key=lambda p: p[1], reverse=True):
            source = source[:at] + switched(text, kind, variants) + source[at + len(text):]
        copy = folder / pathlib.Path(file).name
        copy.write_text(source)
        objects.append(copy.with_suffix(".o"))
        subprocess.run(["c++", "-std=c++20", "-O2", "-w", f"-I{ROOT}", "-isystem",
                        "/usr/include/eigen3", "-include", folder / "switch.hpp", "-c", copy, "-o",
                        objects[-1]], check=True)
    command = subprocess.run(["ninja", "-C", build_folder, "-t", "commands", "-s",
                              "tests/servo/test_servo"], check=True, capture_output=True,
                             text=True).stdout
    link = command.partition("&& ")[2].partition(" && ")[0]
    program = folder / "test_servo"
    first = re.search(r"\S+\.cpp\.o", link).group()
    link = link.replace(first, " ".join(map(str, objects)) + " " + first, 1)
    # A library of a unity build has all of a room in one object: what comes first counts.
    link = re.sub(r"-o \S+test_servo", f"-Wl,-z,muldefs -o {program}", link)
    subprocess.run(link, shell=True, check=True, cwd=build_folder)
    return program


def stages(file):
    """Filters of tests: the likeliest to notice a mutant of `file` first, the slow ones last."""
    near = NEAR.get(pathlib.Path(file).stem)
    return ([f"{near}-{SLOW}"] if near else []) + [f"-{SLOW}", SLOW]


def run_tests(program, number, tests, limit):
    environment = dict(os.environ, PALPATE_MUTANT=str(number), GTEST_FAIL_FAST="1")
    return subprocess.run([program, f"--gtest_filter={tests}"], env=environment, timeout=limit,
                          capture_output=True, text=True, errors="replace")


def time_limits(program):
    """{filter: [s]} after which a mutant hangs: ten times what the tests take without any."""
    limits = {}
    for tests in sorted({t for file in [*NEAR, ""] for t in stages(file)}):
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


def numbers_of(arguments, most):
    """{number} of what "12" and "274-293" name."""
    chosen = set()
    for argument in arguments:
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", argument)
        first, last = (int(n) for n in (match[1], match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last <= most:
            sys.exit(f"mutants: {argument}: no such mutants; there are 1-{most}")
        chosen.update(range(first, last + 1))
    return chosen


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    build_folder = pathlib.Path(sys.argv[1]).resolve()
    mutants = read_list()
    chosen = numbers_of(sys.argv[2:], len(mutants))
    survivors, killed, began = [], 0, time.time()
    with tempfile.TemporaryDirectory() as scratch:
        for i, batch in enumerate(groups(mutants)):
            numbers = [n for piece in batch for n, _ in piece[4] if not chosen or n in chosen]
            if not numbers:
                continue
            folder = pathlib.Path(scratch) / str(i)
            folder.mkdir()
            program = build(batch, build_folder, folder)
            limits = time_limits(program)
            with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
                tried = [(n, workers.submit(noticed, program, n, mutants[n - 1][0], limits))
                         for n in sorted(numbers)]
                for number, result in tried:
                    file, text, _, _, mutant, reason = mutants[number - 1]
                    by = result.result()
                    killed += by is not None and reason is None
                    if by is None and reason is None:
                        survivors.append(number)
                    verdict = ("survives" if by is None else "noticed") if reason is None else (
                        "equivalent" if by is None else "not equivalent")
                    print(f"{verdict}: {number} {file}: {text} => {mutant}" +
                          (f": {by}" if by else ""), flush=True)
    equivalent = sum(m[5] is not None for n, m in enumerate(mutants, 1)
                     if not chosen or n in chosen)
    total = killed + len(survivors)
    print(f"{total + equivalent} mutants, {equivalent} equivalent, {killed} of {total} noticed "
          f"({100.0 * killed / max(total, 1):.1f} %) in {time.time() - began:.0f} s")
    sys.exit(0 if killed >= 0.95 * total else 1)


if __name__ == "__main__":
    main()

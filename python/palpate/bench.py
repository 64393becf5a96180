# SPDX-License-Identifier: Apache-2.0
"""The lab's benchmarks: how well does a method keep contact with a moving, noisy surface?

    palpate.bench.pop("sight", cases=5)
    palpate.bench.pop(MyMethod(), cases=5)
    palpate.bench.entry(MyMethod(), out="mine.json")

The rules are in docs/pop.md and docs/bench.md. The same arguments give the same scores.
"""

import copy
import datetime
import json
import pathlib
import platform
import secrets
import tempfile

from . import _core


class Scores:
    """A benchmark result: `columns` and `rows` of its table, a `note`, and a `csv` of cases."""

    def __init__(self, result):
        self.columns = result["columns"]
        self.rows = result["rows"]
        self.note = result["note"]
        self.csv = result["csv"]

    def __getitem__(self, row):
        """A row by its first column's text: column -> text."""
        for cells in self.rows:
            if cells[0] == row:
                return dict(zip(self.columns, cells))
        raise KeyError(row)

    def __str__(self):
        widths = [max(len(row[i]) for row in [self.columns, *self.rows])
                  for i in range(len(self.columns))]
        lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip()
                 for row in [self.columns, *self.rows]]
        return "\n".join([*lines, self.note])

    __repr__ = __str__


def methods():
    """The methods of the benchmarks: name -> description."""
    return _core._bench_methods()


def _named(method):
    """A method's name, and a factory of new objects: None for the lab's methods."""
    if isinstance(method, str):
        return method, None
    if isinstance(method, type):
        return method.__name__, method
    return type(method).__name__, lambda: copy.deepcopy(method)  # as it was given


def _run(name, wanted, cases, seed, families, jobs, parameters):
    methods = [_named(one) for one in (wanted if isinstance(wanted, (list, tuple)) else [wanted])]
    names = [of_lab for of_lab, make in methods if make is None]
    own = [method for method in methods if method[1] is not None]
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        return Scores(_core._bench(name, names, own, f"{folder}/{name}.csv", cases,
                                   seed, list(families), jobs, **parameters))


def pop(method, *, cases=50, seed=1, families=(), jobs=1, **parameters):
    """Does the proxy pop through? `cases` random cases of each family, from `seed`.

    method: a name, a class or an object derived from palpate.Method, or a list of these. Methods
    in Python gain nothing from more `jobs` than one.
    """
    return _run("pop", method, cases, seed, families, jobs, parameters)


def fidelity(method, *, seed=1, families=(), jobs=1, **parameters):
    """Accuracy and noise of the force, compared with 24 aims. Arguments as for `pop`."""
    return _run("fidelity", method, None, seed, families, jobs, parameters)


def _processor():
    try:
        for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.machine()


def entry(method, out="entry.json", *, seed=None, cases=25, repeats=5, recordings=(), jobs=1):
    """Runs a method on the whole benchmark, writes an entry for the leaderboard and returns it.

    method: a name, 'pipe:COMMAND', or a class or an object derived from palpate.Method. seed:
    random by default, so that methods cannot be tuned to the cases. recordings: URIs, each of a
    camera at rest. docs/bench-entries.md describes the contents of an entry.
    """
    name, make = _named(method)
    run = {"date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
           "processor": _processor(), "python": platform.python_version()}
    return json.loads(_core._bench_entry(
        name, [] if make is None else [(name, make)], str(out),
        secrets.randbits(32) if seed is None else seed, cases, repeats,
        [str(uri) for uri in recordings], jobs, list(run.items())))


def check(file, method=None, *, sample=20, recordings=(), jobs=1):
    """Runs a sample of an entry again and checks it: a dict with `holds`, `differences` and more.

    method: the class or object that the entry was made with, if it is written in Python.
    """
    own = [] if method is None else [_named(method)]
    return _core._bench_check(str(file), [one for one in own if one[1] is not None], sample,
                              secrets.randbits(63), [str(uri) for uri in recordings], jobs)

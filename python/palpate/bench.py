# SPDX-License-Identifier: Apache-2.0
"""The lab's benches: how well does a method hold a surface that moves and is noisy?

    palpate.bench.pop("sight", cases=5)
    palpate.bench.pop(MyMethod(), cases=5)

The rules are in docs/pop.md and docs/bench.md. The same arguments give the same scores.
"""

import copy
import tempfile

from . import _core


class Scores:
    """What a bench came to: `columns` and `rows` of its table, a `note`, and the cases' `csv`."""

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
    """The methods that the benches know by name: name -> what it is."""
    return _core._bench_methods()


def _run(name, wanted, cases, seed, families, jobs, parameters):
    names, own = [], []
    for method in wanted if isinstance(wanted, (list, tuple)) else [wanted]:
        if isinstance(method, str):
            names.append(method)
        elif isinstance(method, type):
            own.append((method.__name__, method))
        else:  # each case begins with the object as it was given
            own.append((type(method).__name__, lambda given=method: copy.deepcopy(given)))
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        return Scores(_core._bench(name, names, own, f"{folder}/{name}.csv", cases,
                                   seed, list(families), jobs, **parameters))


def pop(method, *, cases=50, seed=1, families=(), jobs=1, **parameters):
    """Does the method keep the proxy on the right side? `cases` of each family, drawn from `seed`.

    method: a name, a class or an object derived from palpate.Method, or a list of these. Methods
    in Python gain nothing from more `jobs` than one.
    """
    return _run("pop", method, cases, seed, families, jobs, parameters)


def fidelity(method, *, seed=1, families=(), jobs=1, **parameters):
    """How true, quiet and still is the force, against 24 aims? Arguments as for `pop`."""
    return _run("fidelity", method, None, seed, families, jobs, parameters)

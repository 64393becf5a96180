#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the Python of docs/tutorial, lesson by lesson: `tutorial.py FOLDER` leaves its figures.

They come into docs/tutorial/images with FOLDER=docs/tutorial/images, palpate on PYTHONPATH and
matplotlib installed. tests/python/test_tutorial.py runs the lessons with the same function.
"""

import importlib.util
import os
import pathlib
import re
import sys

LESSONS = pathlib.Path(__file__).resolve().parents[2] / "docs" / "tutorial"


def lessons():
    """The pages, in order."""
    return sorted(LESSONS.glob("[0-9]-*.md"))


def blocks(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


def figures(page):
    """Names of the figures that a page shows."""
    return re.findall(r"\]\(images/([^)]+)\)", page.read_text(encoding="utf-8"))


def run(folder):
    """All blocks, one after the other, as a reader types them; what they write is in `folder`.

    Those that plot are left out where matplotlib is not installed.
    """
    plots = importlib.util.find_spec("matplotlib") is not None
    names, here = {}, os.getcwd()
    os.chdir(folder)
    try:
        for page in lessons():
            for block in blocks(page):
                if "palpate.plot" in block and not plots:
                    continue
                exec(compile(block, page.name, "exec"), names)  # pylint: disable=W0122
    finally:
        os.chdir(here)
    return names


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    target = pathlib.Path(sys.argv[1]).resolve()
    run(target)
    for left in set(target.iterdir()) - {target / name for page in lessons()
                                         for name in figures(page)}:
        left.unlink()

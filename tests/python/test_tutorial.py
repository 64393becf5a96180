# SPDX-License-Identifier: Apache-2.0
"""The lessons of docs/tutorial run as they stand, and make the figures that they show."""

import importlib.util
import os
import pathlib
import sys
import tempfile
import unittest

SOURCES = pathlib.Path(os.environ["PALPATE_SOURCES"])
sys.path.insert(0, str(SOURCES / "scripts" / "figures"))
import tutorial  # noqa: E402  pylint: disable=C0413


class Tutorial(unittest.TestCase):
    def test_its_lessons_run_and_make_their_figures(self):
        self.assertEqual(len(tutorial.lessons()), 6)
        with tempfile.TemporaryDirectory() as folder:
            names = tutorial.run(folder)
            self.assertEqual(names["entry"]["method"], "Free")
            made = {file.name for file in pathlib.Path(folder).glob("*.png")}
        shown = {name for page in tutorial.lessons() for name in tutorial.figures(page)}
        self.assertEqual(len(shown), 4)
        self.assertEqual(made, shown if importlib.util.find_spec("matplotlib") else set())
        there = {file.name for file in (tutorial.LESSONS / "images").iterdir()}
        self.assertEqual(there, shown)


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: Apache-2.0
"""The package as a whole: types, documentation, wheel, and what pandas and matplotlib add."""

import ast
import base64
import hashlib
import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import zipfile

import numpy
import palpate
from palpate import _core

SOURCES = pathlib.Path(os.environ["PALPATE_SOURCES"])


def declared(body):
    """name -> names below it, of the functions, classes and variables of a stub."""
    names = {}
    for node in body:
        if isinstance(node, ast.ClassDef):
            names[node.name] = set(declared(node.body))
        elif isinstance(node, ast.FunctionDef):
            names[node.name] = set()
        elif isinstance(node, ast.AnnAssign):
            names[node.target.id] = set()
        elif isinstance(node, ast.Assign):
            names[node.targets[0].id] = set()
    return names


class Package(unittest.TestCase):
    def test_the_stub_names_what_there_is(self):
        stub = declared(ast.parse((SOURCES / "python/palpate/_core.pyi").read_text()).body)
        there = {name for name in vars(_core) if not name.startswith("_")} | {"__version__"}
        self.assertEqual(set(stub), there)
        for name, members in stub.items():
            found = {member for member, value in vars(getattr(_core, name)).items()
                     if not member.startswith("_") and member not in ("name", "value")} \
                if isinstance(getattr(_core, name), type) else set()
            self.assertEqual({member for member in members if not member.startswith("_")}, found,
                             name)

    def test_everything_is_documented(self):
        self.assertTrue(set(palpate.__all__) <= set(vars(palpate)))
        for name in palpate.__all__:
            each = getattr(palpate, name)
            if name != "__version__":
                self.assertGreater(len(each.__doc__ or ""), 20, name)
        self.assertRegex(palpate.__version__, r"^\d+\.\d+\.\d+$")
        project = (SOURCES / "pyproject.toml").read_text()
        self.assertIn(f'version = "{palpate.__version__}"', project)

    def test_the_wheel_imports_and_is_whole(self):
        with tempfile.TemporaryDirectory() as folder:
            code = ("import build_backend as b, sys; "
                    "print(b.build_wheel(sys.argv[1], {'build-dir': sys.argv[2]}))")
            run = subprocess.run([sys.executable, "-c", code, folder, os.environ["PALPATE_BUILD"]],
                                 env={**os.environ, "PYTHONPATH": str(SOURCES / "python")},
                                 capture_output=True, text=True, check=True)
            name = run.stdout.splitlines()[-1]
            self.assertRegex(name, r"^palpate-[\d.]+-cp3\d+-cp3\d+-linux_\w+\.whl$")
            site = pathlib.Path(folder) / "site"
            with zipfile.ZipFile(pathlib.Path(folder) / name) as wheel:
                wheel.extractall(site)
            (record,) = site.glob("palpate-*.dist-info/RECORD")
            for line in record.read_text().splitlines():
                path, digest, _ = line.rsplit(",", 2)
                if digest:
                    content = (site / path).read_bytes()
                    theirs = base64.urlsafe_b64encode(hashlib.sha256(content).digest())
                    self.assertEqual(digest, "sha256=" + theirs.rstrip(b"=").decode(), path)
            where = subprocess.run(
                [sys.executable, "-c", "import palpate; print(palpate.__file__)"],
                env={**os.environ, "PYTHONPATH": str(site)}, capture_output=True, text=True,
                check=True).stdout
            self.assertIn(str(site), where)

    def test_the_examples_of_its_page_run(self):
        page = (SOURCES / "docs/python.md").read_text()
        blocks = re.findall(r"```python\n(.*?)```", page, re.S)
        self.assertGreater(len(blocks), 4)
        with tempfile.TemporaryDirectory() as folder:
            names = {}
            here = os.getcwd()
            os.chdir(folder)
            try:
                for block in blocks:  # one after the other, as a reader types them
                    if "matplotlib" in block and not importlib.util.find_spec("matplotlib"):
                        continue
                    exec(compile(block, "docs/python.md", "exec"), names)  # pylint: disable=W0122
            finally:
                os.chdir(here)

    @unittest.skipUnless(importlib.util.find_spec("pandas"), "pandas is not installed")
    def test_ticks_as_a_dataframe(self):
        ticks = palpate.trace("synthetic:desk?size=80x60", press=(40, 30), press_hold=0.0)
        frame = palpate.dataframe(ticks)
        self.assertEqual(frame.index.name, "t")
        self.assertTrue(numpy.array_equal(frame["force_z"], ticks["force"][:, 2]))

    @unittest.skipUnless(importlib.util.find_spec("matplotlib"), "matplotlib is not installed")
    def test_ticks_as_a_figure(self):
        ticks = palpate.trace("synthetic:desk?size=80x60", press=(40, 30), press_hold=0.0)
        line = palpate.plot(ticks).axes[0].lines[0]
        self.assertTrue(numpy.array_equal(line.get_ydata(),
                                          numpy.linalg.norm(ticks["force"], axis=1)))


if __name__ == "__main__":
    unittest.main()

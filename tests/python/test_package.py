# SPDX-License-Identifier: Apache-2.0
"""The package as a whole: types, documentation, wheel, and what pandas and matplotlib add."""

import ast
import base64
import contextlib
import hashlib
import importlib.util
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

import numpy
import palpate
from palpate import _core, figures

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
                modes = {info.filename: info.external_attr >> 16 for info in wheel.infolist()}
            (record,) = site.glob("palpate-*.dist-info/RECORD")
            for line in record.read_text().splitlines():
                path, digest, _ = line.rsplit(",", 2)
                if digest:
                    content = (site / path).read_bytes()
                    theirs = base64.urlsafe_b64encode(hashlib.sha256(content).digest())
                    self.assertEqual(digest, "sha256=" + theirs.rstrip(b"=").decode(), path)
            scripts = [path for path in modes if "/scripts/" in path]
            self.assertEqual(scripts, [f"palpate-{palpate.__version__}.data/scripts/{each}"
                                       for each in ("palpate", "palpate-lab")])
            self.assertEqual({modes[path] for path in scripts}, {0o100755})
            where = subprocess.run(
                [sys.executable, "-c", "import palpate; print(palpate.__file__)"],
                env={**os.environ, "PYTHONPATH": str(site)}, capture_output=True, text=True,
                check=True).stdout
            self.assertIn(str(site), where)

    def environment(self, folder, *options):
        """A virtual environment's Python."""
        subprocess.run([sys.executable, "-m", "venv", *options, folder], check=True)
        return str(pathlib.Path(folder) / "bin" / "python")

    def test_numpy_is_asked_for_before_anything_is_built(self):
        code = "import build_backend as b; print(b.get_requires_for_build_wheel())"
        for options, status in (((), 1), (("--system-site-packages",), 0)):
            with tempfile.TemporaryDirectory() as folder:
                run = subprocess.run(
                    [self.environment(folder, "--without-pip", *options), "-c", code],
                    env={**os.environ, "PYTHONPATH": str(SOURCES / "python"),
                         "PIP_BUILD_TRACKER": folder}, capture_output=True, text=True, check=False)
                self.assertEqual(run.returncode, status, run.stderr)
                if status:
                    self.assertRegex(run.stderr, rf"\Apalpate: {folder}/bin/python has no numpy; "
                                     r".*python3-numpy.*--system-site-packages\n\Z")
                else:
                    self.assertEqual(run.stdout, "[]\n")

    @unittest.skipUnless(importlib.util.find_spec("ensurepip"), "python3-venv is not installed")
    def test_pip_installs_package_and_program_and_shows_how_far_it_is(self):
        with tempfile.TemporaryDirectory() as folder:
            python = self.environment(folder, "--system-site-packages")
            tools = pathlib.Path(folder) / "tools"  # a build with something to do
            tools.mkdir()
            (tools / "cmake").write_text("#!/bin/sh\necho '[3/9] Building'\n"
                                         f"exec {shutil.which('cmake')} \"$@\"\n")
            (tools / "cmake").chmod(0o755)
            plain = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
            pip = [python, "-m", "pip", "install", "--no-index", "--config-settings",
                   f"build-dir={os.environ['PALPATE_BUILD']}", str(SOURCES)]
            child, terminal = pty.fork()
            if child == 0:
                os.execve(python, pip, {**plain, "PATH": f"{tools}:{os.environ['PATH']}"})
            shown = b""
            with contextlib.suppress(OSError), open(terminal, "rb", buffering=0) as screen:
                while read := screen.read(4096):
                    shown += read
            self.assertEqual(os.waitpid(child, 0)[1], 0, shown)
            self.assertRegex(shown, b"palpate: built 3 of 9\r\n")
            self.assertNotIn(b"] Building", shown)  # which pip hides
            for command in ([f"{folder}/bin/palpate"], [python, "-m", "palpate"]):
                for arguments, says in (("--version", f"palpate {palpate.__version__}"),
                                        ("eval --list-methods", "god-object")):
                    run = subprocess.run([*command, *arguments.split()], env=plain, cwd=SOURCES,
                                         capture_output=True, text=True, check=True)
                    self.assertIn(says, run.stdout)

    def test_the_clones_root_has_the_package_that_is_installed_or_says_that_none_is(self):
        def run(**environment):
            return subprocess.run([sys.executable, "-c", "import palpate.bench as b\nprint(b)"],
                                  cwd=SOURCES, env={**os.environ, **environment}, text=True,
                                  capture_output=True, check=False)
        self.assertIn(os.environ["PYTHONPATH"], run().stdout)
        self.assertRegex(run(PYTHONPATH="").stderr.splitlines()[-1],
                         r"^ImportError: palpate is not installed for .*pip install \.")

    def test_python_runs_the_program_that_is_on_the_path(self):
        program = pathlib.Path(os.environ["PALPATE_PROGRAM"])
        for path, says in ((program.parent, f"palpate {palpate.__version__}"),
                           ("/nowhere", "is not installed")):
            run = subprocess.run([sys.executable, "-m", "palpate", "--version"], text=True,
                                 env={**os.environ, "PATH": str(path)}, capture_output=True,
                                 check=False)
            self.assertIn(says, run.stdout + run.stderr)

    def test_a_numpy_newer_than_its_pybind11_is_refused(self):
        header = pathlib.Path("/usr/include/pybind11/detail/common.h")
        text = header.read_text() if header.exists() else "VERSION_MINOR 99"
        if int(re.search(r"VERSION_MINOR (\d+)", text)[1]) > 11:
            self.skipTest("this pybind11 knows numpy 2")
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / "numpy.py").write_text("__version__ = '2.1.0'\n")
            run = subprocess.run([sys.executable, "-c", "import palpate"], text=True, check=False,
                                 env={**os.environ,
                                      "PYTHONPATH": f"{folder}:{os.environ['PYTHONPATH']}"},
                                 capture_output=True)
            self.assertRegex(run.stderr.splitlines()[-1], "^ImportError: .*numpy 2.*'numpy<2'")

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
    def test_files_of_the_program_as_figures(self):
        program = os.environ["PALPATE_PROGRAM"]
        listed = subprocess.run([program, "eval", "--list"], check=True, capture_output=True,
                                text=True).stdout
        self.assertEqual({line.split()[0] for line in listed.splitlines()},
                         figures.FIGURES.keys() - {"growth"})
        with tempfile.TemporaryDirectory() as folder:
            def drawn(name, text):
                (pathlib.Path(folder) / name).write_text(text)
                return figures.draw(f"{folder}/{name}")
            held = drawn("pop.csv", "method,family,cases,lost\na,one,4,1\nb,one,4,0\na,two,5,5\n")
            self.assertEqual([list(line.get_xdata()) for line in held.axes[0].lines],
                             [[75.0, 0.0], [100.0]])
            growth = drawn("growth.csv", "series,x,points,tick_us\ncameras,1,70,0.5\n"
                           "cameras,2,140,0.9\nfocal_length,300,28,0.4\n")
            self.assertEqual([list(axes.lines[0].get_xdata()) for axes in growth.axes[:3]],
                             [[], [1.0, 2.0], [28.0]])
            trace = drawn("press.csv", "hip_y,hip_z,proxy_y,proxy_z,force_x,force_y,force_z\n"
                          "1,2,1,3,0,3,4\n")
            self.assertEqual(list(trace.axes[1].lines[0].get_ydata()), [5.0])
            subprocess.run([program, "eval", "fidelity", "--families", "sine", "--methods",
                            "sight,ideal", "--out", folder], check=True, capture_output=True)
            subprocess.run([sys.executable, "-m", "palpate.figures", f"{folder}/fidelity.csv"],
                           check=True, capture_output=True)
            self.assertIn("<svg", (pathlib.Path(folder) / "fidelity.svg").read_text())

    @unittest.skipUnless(importlib.util.find_spec("matplotlib"), "matplotlib is not installed")
    def test_ticks_as_a_figure(self):
        ticks = palpate.trace("synthetic:desk?size=80x60", press=(40, 30), press_hold=0.0)
        line = palpate.plot(ticks).axes[0].lines[0]
        self.assertTrue(numpy.array_equal(line.get_ydata(),
                                          numpy.linalg.norm(ticks["force"], axis=1)))


if __name__ == "__main__":
    unittest.main()

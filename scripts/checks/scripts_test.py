# SPDX-License-Identifier: Apache-2.0
"""Scripts where what they call is slow or fails."""

import importlib.machinery
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import types
import unittest
import unittest.mock

SCRIPTS = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(SCRIPTS))
import poor_link  # noqa: E402
import variants  # noqa: E402

LOADER = importlib.machinery.SourceFileLoader("safety_case", str(SCRIPTS / "safety_case"))
safety_case = importlib.util.module_from_spec(
    importlib.util.spec_from_loader("safety_case", LOADER))
LOADER.exec_module(safety_case)

BUILD = f"set -euo pipefail; source {SCRIPTS}/lib.sh; build_in build"


class SafetyCase(unittest.TestCase):
    def test_has_code_and_tests_for_every_hazard(self):
        case, elements, tests = safety_case.read_case()
        for hazard in case["hazard"]:
            with self.subTest(hazard["id"]):
                self.assertTrue(elements[hazard["id"]])
                self.assertTrue(tests[hazard["id"]])

    def test_is_current_in_the_docs(self):
        self.assertEqual(safety_case.table(), safety_case.TABLE.read_text(),
                         "run scripts/safety_case --table")


class Build(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "build").mkdir()
        (self.folder / "build" / "build.ninja").touch()
        (self.folder / "build" / "CMakeCache.txt").write_text(
            f"CMAKE_HOME_DIRECTORY:INTERNAL={self.folder}\n")

    def build(self, ninja, stderr, arguments=""):
        for name, script in (("ninja", ninja), ("cmake", "")):
            program = self.folder / name
            program.write_text(f"#!/bin/sh\n{script}\n")
            program.chmod(0o755)
        path = f"{self.folder}:{os.environ['PATH']}"
        return subprocess.run(["bash", "-c", BUILD + arguments], cwd=self.folder, stderr=stderr,
                              timeout=60, env={**os.environ, "PATH": path}, check=False)

    def test_shows_errors_whole_however_slowly_they_come_and_fails_as_the_build_does(self):
        done = self.build("printf '@1/2 a.cpp\\nb.cpp: '; sleep 1.5; printf 'error\\n@2/2 b.cpp\\n'"
                          "; printf 'the end'; exit 3", subprocess.PIPE)
        self.assertEqual(done.stderr.decode().splitlines()[-3:],
                         ["bash: building 1 of 2", "b.cpp: error", "the end"])
        self.assertEqual(done.returncode, 3)

    def test_goes_on_when_nobody_reads_what_it_says(self):
        reader, writer = os.pipe()
        os.close(reader)
        done = self.build("for i in 1 2 3 4 5; do echo warning || exit 1; sleep 0.05; done; "
                          "touch built", writer)
        os.close(writer)
        self.assertEqual(done.returncode, 0)
        self.assertTrue((self.folder / "built").exists())

    def test_believes_nothing_of_an_attempt_to_configure_that_failed(self):
        (self.folder / "build" / "build.ninja").unlink()
        self.assertEqual(self.build("", subprocess.PIPE).returncode, 0)
        self.assertFalse((self.folder / "build" / "CMakeCache.txt").exists())

    def test_begins_anew_for_another_compiler_alone(self):
        cache = self.folder / "build" / "CMakeCache.txt"
        cache.write_text(cache.read_text() + "CMAKE_CXX_COMPILER:STRING=/usr/bin/g++\n")
        for compiler, stays in (("g++", True), ("/usr/bin/g++", True), ("clang++", False)):
            self.build("", subprocess.PIPE, f" -DCMAKE_CXX_COMPILER={compiler}")
            self.assertEqual(cache.exists(), stays, compiler)

    def test_says_which_folder_is_full(self):
        done = subprocess.run(["bash", "-c", BUILD], cwd=self.folder, stderr=subprocess.PIPE,
                              env={**os.environ, "TMPDIR": "/dev/full"}, check=False)
        self.assertIn("nothing can be written in /dev/full", done.stderr.decode())
        self.assertEqual(done.returncode, 1)


class PoorLink(unittest.TestCase):
    def test_undoes_what_was_begun_where_a_later_step_fails(self):
        done = []

        def run(command, **_):
            done.append(" ".join(command))
            if "addr" in command:
                raise subprocess.CalledProcessError(2, command)

        opened = set(os.listdir("/proc/self/fd"))
        with unittest.mock.patch("subprocess.run", run), unittest.mock.patch.object(
                poor_link.Link, "tap", lambda _, name: os.open("/dev/null", os.O_RDWR)):
            with self.assertRaises(subprocess.CalledProcessError):
                poor_link.Link(types.SimpleNamespace())
        first = poor_link.SIDES[0]
        self.assertIn(f"ip netns add {first}", done)
        self.assertIn(f"ip netns del {first}", done)
        self.assertEqual(set(os.listdir("/proc/self/fd")), opened)


class Variants(unittest.TestCase):
    def test_of_both_lists_are_of_what_is_in_the_sources(self):
        for file in ("tests/servo/mutants.txt", "lab/ablation.txt"):
            listed = variants.read_list(variants.ROOT / file)
            batches = variants.batches(listed)  # exits, naming what is not there
            self.assertEqual(sum(len(piece.variants) for batch in batches for piece in batch),
                             len(listed))


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: Apache-2.0
"""The .debs of a build: what they are called, need and hold, and that it runs where it lies.

scripts/packages try SUITE installs them into a clean system, which takes minutes and the network.
"""

import gzip
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

BUILD = pathlib.Path(os.environ["PALPATE_BUILD"])
SOURCES = pathlib.Path(os.environ["PALPATE_SOURCES"])
VERSION = re.search(r"project\(palpate VERSION (\S+)", (SOURCES / "CMakeLists.txt").read_text())[1]
EXPECTED = {
    "palpate": ["usr/bin/palpate", "usr/bin/palpate-lab", "usr/share/man/man1/palpate.1.gz",
                "usr/share/bash-completion/completions/palpate"],
    "libpalpate-dev": ["usr/include/palpate/kernel/core/method.hpp", "libpalpate_core.a",
                       "cmake/palpate/palpateConfig.cmake", "pkgconfig/palpate.pc"],
    "python3-palpate": ["usr/lib/python3/dist-packages/palpate/__init__.py", "palpate/py.typed"],
}


def run(*command, **options):
    return subprocess.run(command, check=True, capture_output=True, text=True, **options).stdout


@unittest.skipUnless(all(map(shutil.which, ("dpkg-deb", "dpkg-shlibdeps", "file"))),
                     "dpkg-dev or file is not installed: scripts/setup packages")
class Packages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="palpate-packages-")
        cls.addClassCleanup(cls.folder.cleanup)
        cls.root = pathlib.Path(cls.folder.name) / "root"
        run("cpack", "-B", cls.folder.name, cwd=BUILD)
        found = sorted(pathlib.Path(cls.folder.name).glob("**/*.deb"))
        cls.debs = {deb.name.split("_")[0]: deb for deb in found}
        for deb in cls.debs.values():
            run("dpkg-deb", "-x", str(deb), str(cls.root))

    def test_they_are_three_of_this_version_with_what_they_need(self):
        self.assertEqual(set(self.debs), set(EXPECTED))
        for name, deb in self.debs.items():
            field = {key: run("dpkg-deb", "-f", str(deb), key).strip()
                     for key in ("Version", "Depends", "Maintainer", "Description", "Section")}
            self.assertEqual(field["Version"], VERSION)
            self.assertRegex(field["Maintainer"], r".+ <\S+@\S+>")
            self.assertRegex(field["Section"], r"science|libdevel|python")
            synopsis, _, rest = field["Description"].partition("\n")
            self.assertLess(len(synopsis), 80)  # as lintian asks
            self.assertTrue(rest.startswith(" ") and len(rest) > 20, name)
            self.assertNotIn("-dev" if name != "libpalpate-dev" else "libc6", field["Depends"])
        python = run("dpkg-deb", "-f", str(self.debs["python3-palpate"]), "Depends")
        self.assertRegex(python, r"python3 \(>= 3\.\d+\), python3 \(<< 3\.\d+\), python3-numpy")
        self.assertIn("libsqlite3-0", python)

    def test_their_files_are_where_and_as_a_system_has_them(self):
        for name, deb in self.debs.items():
            lines = [line.split(None, 5) for line in run("dpkg-deb", "-c", str(deb)).splitlines()]
            files = {line[5].removeprefix("./"): line[0] for line in lines}
            self.assertEqual({line[1] for line in lines}, {"root/root"})
            for wanted in [*EXPECTED[name], f"usr/share/doc/{name}/copyright"]:
                self.assertTrue(any(file.endswith(wanted) for file in files), f"{name}: {wanted}")
            for file, mode in files.items():
                self.assertTrue(not file or file.startswith("usr/"), file)
                wanted = "drwxr-xr-x" if file.endswith("/") or not file else \
                    "-rwxr-xr-x" if file.startswith("usr/bin/") else "-rw-r--r--"
                self.assertEqual(mode, wanted, file)
        for kind in ("*.cmake", "*.pc"):
            for file in self.root.rglob(kind):
                self.assertNotIn(str(BUILD), file.read_text(), file)

    def test_the_programs_run_and_their_manual_has_every_verb(self):
        program = self.root / "usr/bin/palpate"
        self.assertEqual(run(program, "--version"), f"palpate {VERSION}\n")
        out = pathlib.Path(self.folder.name) / "press.csv"
        run(program, "trace", "--camera", "synthetic:plane?size=80x60", "--press", "40,30", "--out",
            out, "--method", "surfels")  # which palpate-lab knows
        self.assertGreater(out.stat().st_size, 10_000)
        text = run(self.root / "usr/bin/palpate-lab", "--help")
        verbs = re.findall(r"^  ([a-z][a-z-]*) ", text, re.M)
        self.assertIn("bench-entry", verbs)
        manual = gzip.open(self.root / "usr/share/man/man1/palpate.1.gz", "rt").read()
        for verb in verbs:
            self.assertIn("\n.SS " + verb.replace("-", "\\-") + "\n", manual)
        completion = self.root / "usr/share/bash-completion/completions/palpate"
        script = (f"source {completion}; COMP_WORDS=(palpate bench-entry --re) COMP_CWORD=2; "
                  "_palpate; echo ${COMPREPLY[*]}; COMP_WORDS=(palpate bench) COMP_CWORD=1; "
                  "_palpate; echo ${COMPREPLY[*]}")
        self.assertEqual(run("bash", "-c", script).splitlines(),
                         ["--repeats --recording --resume", "bench-entry bench-check"])

    def test_python_finds_its_package(self):
        path = self.root / "usr/lib/python3/dist-packages"
        version = run("/usr/bin/python3", "-c", "import palpate; print(palpate.__version__)",
                      env=os.environ | {"PYTHONPATH": str(path)})
        self.assertEqual(version.strip(), VERSION)

    def test_its_compiled_files_go_with_it(self):
        control = pathlib.Path(self.folder.name) / "control"
        run("dpkg-deb", "-e", str(self.debs["python3-palpate"]), str(control))
        for script, word in (("postinst", "py3compile"), ("prerm", "py3clean")):
            self.assertIn(word, (control / script).read_text())
            self.assertTrue(os.access(control / script, os.X_OK), script)

    @unittest.skipUnless(shutil.which("pkg-config"), "no pkg-config here")
    def test_pkg_config_says_how_to_compile_and_link(self):
        (config,) = self.root.rglob("palpate.pc")
        said = run("pkg-config", "--cflags", "--libs", "palpate",
                   env=os.environ | {"PKG_CONFIG_PATH": str(config.parent)})
        program = pathlib.Path(self.folder.name) / "touch"
        run("g++", "-std=c++20", SOURCES / "examples/touch_a_plane.cpp", "-o", program,
            *said.split())
        self.assertRegex(run(program), r"proxy at 0\.995 m, force 1\d")


if __name__ == "__main__":
    unittest.main()

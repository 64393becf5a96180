# SPDX-License-Identifier: Apache-2.0
"""Builds the wheel with CMake (PEP 517): what `pip install .` calls. Needs no network.

`--config-settings build-dir=DIR` uses a build folder that there is; otherwise it is one of the
interpreter's version in build/, or a temporary one where the sources cannot be written to.
"""

import base64
import hashlib
import importlib.util
import os
import pathlib
import re
import shutil
import stat
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import time
import tomllib
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
NOT_SOURCES = {".git", "build", "node_modules", "dist", "__pycache__"}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
TITLE = f"{PROJECT['name']}-{PROJECT['version']}"


def _metadata():
    lines = ["Metadata-Version: 2.1", f"Name: {PROJECT['name']}", f"Version: {PROJECT['version']}",
             f"Summary: {PROJECT['description']}", f"License: {PROJECT['license']['text']}",
             f"Requires-Python: {PROJECT['requires-python']}"]
    lines += [f"Requires-Dist: {name}" for name in PROJECT["dependencies"]]
    lines += ["Description-Content-Type: text/markdown", "",
              (ROOT / PROJECT["readme"]).read_text(encoding="utf-8")]
    return "\n".join(lines)


def _tag():
    """What the wheel is good for."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    return f"{python}-{python}-{platform}"


def _say(text):
    """Shows a line on the terminal, if there is one: pip hides what a build prints."""
    try:
        with open("/dev/tty", "w", encoding="utf-8") as terminal:
            terminal.write(f"\r\033[Kpalpate: {text}\n")
    except OSError:
        pass


def _run(*command):
    """Prints what a command says, and says every five seconds how far ninja has come."""
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   text=True, errors="replace",
                                   env={**os.environ, "NINJA_STATUS": "[%f/%t] "})
    except FileNotFoundError:
        sys.exit(f"palpate: {command[0]}: it is not installed; run scripts/setup build python")
    said = -float("inf")
    with process:
        for line in process.stdout:
            print(line, end="", flush=True)
            built = re.match(r"\[([1-9]\d*)/(\d+)\]", line)
            if built and time.monotonic() > said + 5:
                said = time.monotonic()
                _say(f"built {built[1]} of {built[2]}")
    if process.returncode:
        sys.exit(f"palpate: {command[0]} failed with status {process.returncode}: its messages are "
                 "above; what the build needs is installed by scripts/setup build python")


def _install(folder, settings):
    """Builds package and programs, and puts them below `folder`."""
    build = (settings or {}).get("build-dir")
    if build is None:
        build = str((ROOT if os.access(ROOT, os.W_OK) else folder) / "build" /
                    f"pip-{sys.implementation.cache_tag}")
        _say(f"building in {build}, for some minutes; `pip install -v .` shows everything")
        if not (ROOT / "web" / "dist" / "index.html").exists():
            _say("the program will have no page, as web/dist is not there: scripts/run makes it")
        launcher = ["-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
        _run("cmake", "-G", "Ninja", "-S", str(ROOT), "-B", build, "-DCMAKE_BUILD_TYPE=Release",
             "-DCMAKE_UNITY_BUILD=ON", "-DPALPATE_PYTHON=ON", "-DPALPATE_TESTS=OFF",
             f"-DPython3_EXECUTABLE={sys.executable}",
             *launcher)
    _run("cmake", "--build", build, "--target", "palpate_python", "palpate", "palpate-lab",
         "--parallel", str(len(os.sched_getaffinity(0))))
    for component in ("python", "wheel"):
        _run("cmake", "--install", build, "--component", component, "--strip", "--prefix",
             str(folder / "prefix"))
    (package,) = (folder / "prefix").glob("**/palpate/__init__.py")
    return package.parent, folder / "prefix" / "bin"


def get_requires_for_build_wheel(config_settings=None):
    """Of Python nothing; but without numpy the package is of no use, so it is asked for first."""
    # Of other front ends than pip this is not the interpreter that the package is for.
    if "PIP_BUILD_TRACKER" in os.environ and not importlib.util.find_spec("numpy"):
        outside = {name: value for name, value in os.environ.items()
                   if name not in ("PYTHONPATH", "PYTHONNOUSERSITE")}  # of pip's isolation
        if subprocess.run([sys.executable, "-c", "import numpy"], env=outside, check=False,
                          stderr=subprocess.DEVNULL).returncode:
            sys.exit(f"palpate: {sys.executable} has no numpy; install the distribution's first: "
                     "sudo apt-get install python3-numpy, which a virtual environment sees if it "
                     "is made with --system-site-packages")
    return []


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Writes what is known without building, and returns its folder's name."""
    info = pathlib.Path(metadata_directory) / f"{TITLE}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(_metadata(), encoding="utf-8")
    (info / "WHEEL").write_text("Wheel-Version: 1.0\nGenerator: palpate\n"
                                f"Root-Is-Purelib: false\nTag: {_tag()}\n", encoding="utf-8")
    return info.name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Makes the wheel and returns its file's name."""
    name = f"{TITLE}-{_tag()}.whl"
    with tempfile.TemporaryDirectory(prefix="palpate-wheel-") as temporary:
        temporary = pathlib.Path(temporary)
        info = prepare_metadata_for_build_wheel(temporary)
        package, programs = _install(temporary, config_settings)
        members = {f"{below}/{file.name}": file.read_bytes()
                   for below, folder in (("palpate", package), (f"{TITLE}.data/scripts", programs),
                                         (info, temporary / info))
                   for file in sorted(folder.iterdir()) if file.is_file()}
    record = []
    for path, content in members.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record.append(f"{path},sha256={digest},{len(content)}")
    record.append(f"{info}/RECORD,,")
    members[f"{info}/RECORD"] = ("\n".join(record) + "\n").encode()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in members.items():
            member = zipfile.ZipInfo(path)  # of 1980, so that the same sources give the same file
            member.compress_type = zipfile.ZIP_DEFLATED
            executable = path.endswith(".so") or "/scripts/" in path
            member.external_attr = (stat.S_IFREG | (0o755 if executable else 0o644)) << 16
            wheel.writestr(member, content)
    return name


def build_sdist(sdist_directory, config_settings=None):
    """Packs the sources and returns the file's name."""
    with tempfile.TemporaryDirectory(prefix="palpate-sdist-") as temporary:
        copy = pathlib.Path(temporary) / TITLE
        shutil.copytree(ROOT, copy, symlinks=True,
                        ignore=lambda folder, names: NOT_SOURCES.intersection(names))
        (copy / "PKG-INFO").write_text(_metadata(), encoding="utf-8")
        with tarfile.open(pathlib.Path(sdist_directory) / f"{TITLE}.tar.gz", "w:gz") as archive:
            archive.add(copy, arcname=TITLE)
    return f"{TITLE}.tar.gz"

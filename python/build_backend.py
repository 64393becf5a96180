# SPDX-License-Identifier: Apache-2.0
"""Builds the wheel with CMake (PEP 517): what `pip install .` calls. Needs no network.

`--config-settings build-dir=DIR` uses a build folder that there is; otherwise it is build/python.
"""

import base64
import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import tomllib
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
NOT_SOURCES = {".git", "build", "node_modules", "dist", "__pycache__"}


def _project():
    with open(ROOT / "pyproject.toml", "rb") as file:
        return tomllib.load(file)["project"]


def _metadata(project):
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {project['version']}",
             f"Summary: {project['description']}", f"License: {project['license']['text']}",
             f"Requires-Python: {project['requires-python']}"]
    lines += [f"Requires-Dist: {name}" for name in project["dependencies"]]
    lines += ["Description-Content-Type: text/markdown", "",
              (ROOT / project["readme"]).read_text(encoding="utf-8")]
    return "\n".join(lines)


def _run(*command):
    try:
        subprocess.run(command, check=True)
    except FileNotFoundError:
        sys.exit(f"palpate: {command[0]}: it is not installed; run scripts/setup build python")
    except subprocess.CalledProcessError as error:
        sys.exit(f"palpate: {command[0]} failed with status {error.returncode}: its messages are "
                 "above; what the build needs is installed by scripts/setup build python")


def _install(folder, settings):
    """Builds the package and puts it below `folder`."""
    build = (settings or {}).get("build-dir")
    if build is None:
        build = str(ROOT / "build" / "python")
        _run("cmake", "-S", str(ROOT), "-B", build, "-DCMAKE_BUILD_TYPE=Release",
             "-DCMAKE_UNITY_BUILD=ON", "-DPALPATE_PYTHON=ON", "-DPALPATE_APP=OFF",
             "-DPALPATE_TESTS=OFF", f"-DPython3_EXECUTABLE={sys.executable}")
    _run("cmake", "--build", build, "--target", "palpate_python", "--parallel",
         str(os.cpu_count() or 1))
    _run("cmake", "--install", build, "--component", "python", "--prefix", str(folder / "prefix"))
    (package,) = (folder / "prefix").glob("**/palpate/__init__.py")
    return package.parent


def get_requires_for_build_wheel(config_settings=None):
    return []


def get_requires_for_build_sdist(config_settings=None):
    return []


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Makes the wheel and returns its file's name."""
    project = _project()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"{python}-{python}-{platform}"
    info = f"{project['name']}-{project['version']}.dist-info"
    name = f"{project['name']}-{project['version']}-{tag}.whl"
    with tempfile.TemporaryDirectory(prefix="palpate-wheel-") as temporary:
        package = _install(pathlib.Path(temporary), config_settings)
        members = {f"palpate/{file.name}": file.read_bytes() for file in sorted(package.iterdir())
                   if file.is_file()}
    members[f"{info}/METADATA"] = _metadata(project).encode()
    members[f"{info}/WHEEL"] = ("Wheel-Version: 1.0\nGenerator: palpate\n"
                                f"Root-Is-Purelib: false\nTag: {tag}\n").encode()
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
            member.external_attr = (0o755 if path.endswith(".so") else 0o644) << 16
            wheel.writestr(member, content)
    return name


def build_sdist(sdist_directory, config_settings=None):
    """Packs the sources and returns the file's name."""
    project = _project()
    top = f"{project['name']}-{project['version']}"
    with tempfile.TemporaryDirectory(prefix="palpate-sdist-") as temporary:
        copy = pathlib.Path(temporary) / top
        shutil.copytree(ROOT, copy, symlinks=True,
                        ignore=lambda folder, names: NOT_SOURCES.intersection(names))
        (copy / "PKG-INFO").write_text(_metadata(project), encoding="utf-8")
        with tarfile.open(pathlib.Path(sdist_directory) / f"{top}.tar.gz", "w:gz") as archive:
            archive.add(copy, arcname=top)
    return f"{top}.tar.gz"

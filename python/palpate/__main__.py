# SPDX-License-Identifier: Apache-2.0
"""`python -m palpate` is the program palpate that was installed with the package."""

import importlib.metadata
import os
import shutil
import sys


def _program():
    try:
        files = importlib.metadata.files("palpate") or []
    except importlib.metadata.PackageNotFoundError:  # not by pip: as a Debian package, or by CMake
        files = []
    ours = [str(file.locate()) for file in files if file.parts[-2:] == ("bin", "palpate")]
    return next(filter(os.path.exists, ours), shutil.which("palpate"))


if __name__ == "__main__":
    program = _program()
    if program is None:
        sys.exit("palpate: the program is not installed; `pip install .` in the sources installs "
                 "it beside the package, scripts/run builds it and runs it there")
    os.execv(program, ["palpate", *sys.argv[1:]])

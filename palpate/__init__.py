# SPDX-License-Identifier: Apache-2.0
"""The C++ library's folder, which Python takes for the package palpate where its parent is the
current folder: gives the package that is installed instead."""

import importlib.machinery
import importlib.util
import os
import sys

_here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_spec = importlib.machinery.PathFinder.find_spec(
    "palpate", [path for path in sys.path if os.path.realpath(path) != os.path.realpath(_here)])
if _spec is None or _spec.loader is None:
    raise ImportError(f"palpate is not installed for {sys.executable}, and {_here}/palpate is its "
                      "C++ library; run `pip install .` there (docs/python.md)")
sys.modules["palpate"] = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(sys.modules["palpate"])

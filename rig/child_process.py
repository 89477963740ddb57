"""The command that runs a module of this program in a process of its own.

``python -m`` looks for modules in the working folder first, where a recording's files lie and a stranger's ``json.py``
may. The child takes nothing from there, and its packages from where this process has them: an environment,
``PYTHONPATH``, or a source tree.
"""

import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
"""Folder of the packages that this process runs."""
LAUNCHER = """\
import runpy, sys
from importlib.util import find_spec
root, module, here = sys.argv[1], sys.argv[2], find_spec("rig")
if here is None or list(here.submodule_search_locations or ()) != [sys.argv[3]]:
    sys.path.insert(0, root)
sys.argv[:] = [module, *sys.argv[4:]]
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def child_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of this program as ``__main__``, with its arguments."""
    return [sys.executable, "-P", "-c", LAUNCHER, ROOT, module, os.path.join(ROOT, "rig"), *arguments]

"""Every process that this program starts: a module of its own, a line of Python, another program.

``python -m`` and ``python -c`` look for modules in the working folder first, where a recording's files lie and a
stranger's ``json.py`` may; Windows looks there for programs. A child takes nothing from there, and its packages from
where this process has them: an environment, ``PYTHONPATH``, or a source tree.
"""

import os
import subprocess
import sys
from typing import Any

ChildProcess = subprocess.Popen[bytes]
"""A process that was started."""
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


def processors() -> int:
    """Return how many processors this process may use; all there are where the system does not tell."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def start_module(module: str, *arguments: str, **pipes: Any) -> subprocess.Popen[bytes]:
    """Run a module of this program as ``__main__``, with its arguments; ``pipes`` as of :class:`subprocess.Popen`.

    Raises:
        OSError: no process can be started.
    """
    return start_python(LAUNCHER, ROOT, module, os.path.join(ROOT, "rig"), *arguments, **pipes)


def start_python(code: str, *arguments: str, **pipes: Any) -> subprocess.Popen[bytes]:
    """Run a text of Python, in which ``sys.argv[1:]`` are the arguments. Raises OSError as :func:`start_module`."""
    return subprocess.Popen([sys.executable, "-P", "-c", code, *arguments], **pipes)  # noqa: S603 - ourselves


def start_program(name: str, *arguments: str, **pipes: Any) -> subprocess.Popen[bytes]:
    """Run a program from the folders of ``PATH`` that are given from the root on. Raises OSError: it is in none."""
    for folder in filter(os.path.isabs, os.get_exec_path()):
        for program in (os.path.join(folder, name), os.path.join(folder, f"{name}.exe")):
            if os.path.isfile(program) and os.access(program, os.X_OK):
                return subprocess.Popen([program, *arguments], **pipes)  # noqa: S603 - of the user's own folders
    raise FileNotFoundError(f"no program {name}")

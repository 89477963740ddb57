"""Every notebook runs from its first cell to its last in a fresh kernel of this interpreter."""

import os
import re
from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

from uq.files.compilation_cache import cache_folder

NOTEBOOKS = sorted(Path(__file__).parent.glob("*.ipynb"))
FEW = 20


def client(notebook, folder):
    """Return a client whose kernel is this interpreter's, whatever kernels the machine's user has installed."""
    made = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    made.create_kernel_manager()
    made.km.kernel_spec_manager = KernelSpecManager(kernel_dirs=[], ensure_native_kernel=True)
    return made


def with_trials(notebook, most):
    """The notebook with no more than so many trials in each call."""
    for cell in notebook.cells:
        cell.source = re.sub(r"trials=(\d+)", lambda found: f"trials={min(int(found[1]), most)}", cell.source)
    return notebook


@pytest.mark.parametrize("most", [FEW, pytest.param(10**9, marks=pytest.mark.study)], ids=["brief", "whole"])
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, most, tmp_path, monkeypatch):
    """With a few trials; in the study as it stands."""
    if "INERTIA_CACHE" in os.environ:  # what the other tests have compiled
        monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(cache_folder()))
        monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    before = path.read_bytes()
    notebook = nbformat.reads(before.decode(), as_version=4)
    client(with_trials(notebook, most), tmp_path).execute()
    assert path.read_bytes() == before


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_with_its_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert path.stat().st_size < 1_000_000

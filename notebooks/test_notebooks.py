"""Every notebook runs from its first cell to its last in a fresh kernel of this interpreter (`make notebooks`)."""

from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

NOTEBOOKS = sorted(Path(__file__).parent.glob("*.ipynb"))


def client(notebook, folder):
    """Return a client whose kernel is this interpreter's, whatever kernels the machine's user has installed."""
    made = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    made.create_kernel_manager()
    made.km.kernel_spec_manager = KernelSpecManager(kernel_dirs=[], ensure_native_kernel=True)
    return made


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path):
    before = path.read_bytes()
    notebook = nbformat.reads(before.decode(), as_version=4)
    client(notebook, tmp_path).execute()
    assert path.read_bytes() == before


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_with_its_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    assert path.stat().st_size < 1_000_000

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


def client(notebook, folder):
    """Return a client whose kernel is this interpreter's, whatever kernels the machine's user has installed."""
    made = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    made.create_kernel_manager()
    made.km.kernel_spec_manager = KernelSpecManager(kernel_dirs=[], ensure_native_kernel=True)
    return made


SHORTER = {
    r'jax.config.update."jax_num_cpu_devices".*': "",
    r"trials=(\d+)": lambda text: f"trials={min(int(text[1]), 20)}",
    r"starts=\d+, period=2.0, rounds=\d+, steps=\d+": "starts=1, period=2.0, rounds=2, steps=10",
    r"steps=40, random=5": "steps=40, random=1",
    r"designed = design_arm\(": "from uq.plan.motion_design.arm import arm_design\n"
    "arm_design.FREQUENCIES = 1\n"
    "arm_design.searched = lambda search, *_, **__: (arm_design.random_series(search, 1, 1), [])\n"
    "designed = design_arm(",
    r"found = design\(": "from identify.motion.optimiser import Optimum\n"
    "from dataclasses import replace\n"
    "from uq.plan.motion_design import search\n"
    "from uq.plan.motion_design.hexapod import design as designs, rig_limits\n"
    "search.minimise = lambda lagrangian, first, **_: Optimum(first, 0.0, 0.0, 0)\n"
    "designs.best_reference = lambda experiment, given, limits, *_: designs.PredictedTrajectory.of(\n"
    "    experiment, replace(given, trajectory=given.trajectory.scaled(0.1)), limits.bandwidth\n)\n"
    "rig_limits.HALVINGS, rig_limits.PIECE = 3, 4096\nfound = design(",
    r"in spoiled\.items\(\)": "in list(spoiled.items())[:1]",
    r"in cures\.items\(\)": "in cures.items() if name in paths",
    r"SAMPLES = 72_000": "SAMPLES = 12_000",
    r"100\.0, 200\.0, 300\.0, 400\.0, 500\.0": "500.0, 500.0, 500.0, 500.0, 500.0",
    r"duration=20\.0, period=4\.0": "duration=8.0, period=2.0, ramp=1.0",
    r'"duration": "20 s", "ramp": "3 s"': '"duration": "8 s", "ramp": "2 s"',
}
"""What a brief run replaces: few trials, no search, one device, a part of the samples and of the spoiled runs."""


def shortened(notebook):
    """The notebook with less to compute."""
    for cell in notebook.cells:
        for pattern, less in SHORTER.items():
            cell.source = re.sub(pattern, less, cell.source)
    return notebook


FAST = {"02_recording", "03_anybodys_recording"}
"""What the others compute and search has tests of its own, and how-to pages whose blocks run."""
CASES = [pytest.param(path, id=path.stem, marks=() if path.stem in FAST else pytest.mark.slow) for path in NOTEBOOKS]


@pytest.mark.parametrize("brief", [True, pytest.param(False, marks=pytest.mark.study)], ids=["brief", "whole"])
@pytest.mark.parametrize("path", CASES)
def test_notebook_runs(path, brief, tmp_path, monkeypatch):
    """With less to compute; in the study as it stands."""
    if "INERTIA_CACHE" in os.environ:  # what the other tests have compiled
        monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(cache_folder()))
        monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    before = path.read_bytes()
    notebook = nbformat.reads(before.decode(), as_version=4)
    client(shortened(notebook) if brief else notebook, tmp_path).execute()
    assert path.read_bytes() == before


def test_what_is_shortened_is_in_a_notebook():
    cells = [cell.source for path in NOTEBOOKS for cell in nbformat.read(path, as_version=4).cells]
    assert not [pattern for pattern in SHORTER if not any(re.search(pattern, source) for source in cells)]


def test_notebooks_are_committed_with_their_outputs():
    for path in NOTEBOOKS:
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        code = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
        assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1)), path.name
        assert path.stat().st_size < 1_000_000, path.name

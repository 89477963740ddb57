"""Real recordings, where they are at hand: they are not part of the project and stay outside of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from uq.experiment import Experiment
from uq.recorded import identify_files

ROOT = Path(__file__).parent.parent
THROWS = ROOT.parent / "shared" / "data" / "throws"
MOMENTS = ["I11", "I22", "I33"]


@pytest.mark.skipif(not THROWS.exists(), reason="the recordings of thrown bodies are not at hand")
@pytest.mark.parametrize("body", ["a", "empty"])
def test_thrown_bodies_have_their_geometrys_moments(body):
    files = sorted(THROWS.glob(f"{body}_*.mcap"))
    result = identify_files(files, Experiment.load(ROOT / "docs" / "experiments" / "throws.toml"))
    truth = json.loads((THROWS / "truth.json").read_text())[body]
    assert len(result.runs) == truth["runs"]
    expected = 1e-6 * np.array([truth["inertia_total_about_cg_kgmm2"][name] for name in MOMENTS])
    pooled = np.array([result.to_dict()["inertia"][name] for name in MOMENTS])
    mean = np.mean([run.inertia[[0, 3, 5]] for run in result.runs], axis=0)
    np.testing.assert_allclose(pooled, expected, rtol=0.03)
    np.testing.assert_allclose(mean, expected, rtol=0.03)

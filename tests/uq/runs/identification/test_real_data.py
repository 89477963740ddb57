"""Real recordings, where they are at hand: they are not part of the project and stay outside of it."""

import json
from pathlib import Path

import numpy as np
import pytest

from identify.exceptions import RunError
from identify.identification import identify
from identify.rigid_body.inertia import COMPONENTS
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.systematic_errors import with_declared_sources
from uq.runs.inspection.inspect_run import inspect_run
from uq.runs.recorded.load_run import load_run

ROOT = Path(__file__).parents[4]
THROWS = ROOT.parent / "shared" / "data" / "throws"
MOMENTS = [0, 3, 5]
pytestmark = [
    pytest.mark.skipif(not THROWS.exists(), reason="the recordings of thrown bodies are not at hand"),
    pytest.mark.usefixtures("unjudged"),
]


@pytest.fixture(scope="module")
def experiment():
    """With the sources that it declares: sensor axes within 1.5 deg, the flywheel's calibration within 0.5 %."""
    return Experiment.load(ROOT / "uq" / "examples" / "throws.toml")


@pytest.fixture(scope="module", params=["a", pytest.param("empty", marks=pytest.mark.study)])
def thrown(request, experiment):
    """The files of a body, its true tensor [kg·m²], and the runs pooled."""
    files = sorted(THROWS.glob(f"{request.param}_*.mcap"))
    truth = json.loads((THROWS / "truth.json").read_text())[request.param]
    tensor = 1e-6 * np.array([truth["inertia_total_about_cg_kgmm2"][name] for name in COMPONENTS])
    assert len(files) == truth["runs"]
    return files, tensor, identify_files(files, experiment)


def test_thrown_bodies_have_their_geometrys_moments(thrown):
    """Within 1 %, and the smallest moment of the longer body within 2.5 %; pooled as well as averaged."""
    _, truth, result = thrown
    mean = np.mean([run.inertia for run in result.runs], axis=0)
    smallest = np.argmin(truth[MOMENTS])
    for value in (mean, result.inertia):
        error = np.abs(value / truth - 1)[MOMENTS]
        assert error[smallest] < 0.025
        assert np.delete(error, smallest).max() < 0.01


def test_intervals_of_thrown_bodies_hold_their_geometry(thrown, experiment):
    """Of single runs at least nine in ten, component by component; and those of the runs pooled."""
    files, truth, result = thrown
    covered = []
    for file in files:
        run = load_run(file, experiment.recording)
        alone = identify(
            run, r_cg=experiment.stated_r_cg, estimator=experiment.estimator(), offsets=experiment.recording.offsets
        )
        low, high = with_declared_sources(alone, [run], experiment).interval95.T
        covered.append((low <= truth) & (truth <= high))
    print(dict(zip(COMPONENTS, np.mean(covered, axis=0).round(3), strict=True)))
    assert (np.mean(covered, axis=0) >= 0.9).all()
    low, high = result.interval95.T
    assert ((low <= truth) & (truth <= high)).all()


def test_of_thrown_bodies_nothing_is_suspected(thrown, experiment):
    """But for the force that no load cell measures, where the experiment does not say that it plays no part."""
    for file in thrown[0]:
        assert [finding.kind for finding in inspect_run(file).findings] == ["no force"]
        assert inspect_run(file, experiment).findings == []
    assert not [text for text in thrown[2].warnings if "suspicious" in text]


def test_thrown_bodies_scatter_about_as_their_residuals_predict(thrown):
    """Ten runs know a standard deviation to 24 %. What all runs lack alike is in their residuals, not in their scatter.

    One slope of the spectrum for all axes gives 0.23 for a moment of body a.
    """
    found = thrown[2].pooling
    print(1e6 * found.between_runs, 1e6 * found.predicted)
    ratio = found.between_runs / found.predicted
    assert ((ratio > 0.25) & (ratio < 2)).all()
    assert (ratio[MOMENTS] > 0.4).all()


def test_throws_are_too_brief_for_weights_and_gls_is_as_least_squares(thrown, experiment):
    """Half a second behind 10 Hz has some eight lines: weights learnt from them missed five moments of six."""
    files, truth, _ = thrown
    runs = [load_run(file, experiment.recording) for file in files]
    alone = identify(runs, r_cg=experiment.stated_r_cg, estimator=experiment.estimator(), offsets="none", method="gls")
    assert any("too short to estimate weights" in text for text in alone.warnings)
    low, high = with_declared_sources(alone, runs, experiment).interval95.T
    assert ((low <= truth) & (truth <= high))[MOMENTS].all()


def test_throws_are_too_brief_for_the_joint_estimate_which_says_so(thrown, experiment):
    with pytest.raises(
        RunError, match=r"lasts 0\.5\d* s, too short .* of 10 Hz: record for longer, or use the method source"
    ):
        identify_files(thrown[0], experiment, method="joint")

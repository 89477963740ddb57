"""Type A of pooled runs of a rig, and what a user can do wrong with mountings."""

import dataclasses

import numpy as np
import pytest

from identify.identification import identify
from identify.results.ledger import type_a_rows
from identify.signals.run import RunError
from tests.helpers import laboratory_files
from tests.helpers.changed_result import not_judged
from tests.helpers.equal_runs import OWN, pooled
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import identified_files
from tests.helpers.recordings import silenced
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import labelled, mounting_names
from uq.runs.identification.run_scatter import pooled_scatter_verdict
from uq.runs.identification.systematic_errors import with_declared_sources
from uq.sources.source import Source


def test_runs_of_a_rig_scatter_by_mounting(short, unjudged):
    """A centre of gravity that is another in each mounting shows between them, and is not taken for the runs' own."""
    short = dataclasses.replace(short, inertia=np.array([0.38, 0.0, 0.0, 0.25, 0.0, 0.35]))  # far from what no body has
    sources = [dataclasses.replace(s, sigma=0.5 * s.sigma) for s in short.sources if s.kind == "precision"]
    clean = simulate(silenced(short), "T2").run
    rng, sigma, runs = np.random.default_rng(7), {s.name: s.sigma for s in sources}, []
    for mounting, shift in zip("ABC", rng.normal(0, 4e-3, (3, 3)), strict=True):
        for _ in range(2):
            noise = [
                sigma[f"{signal}_precision"] * rng.standard_normal(clean.omega.shape) for signal in ("F", "M", "omega")
            ]
            moment = clean.moment + np.cross(shift, clean.force) + noise[1]
            runs.append(dataclasses.replace(
                clean, force=clean.force + noise[0], moment=moment, omega=clean.omega + noise[2], mounting=mounting,
            ))  # fmt: skip
    result = identify(runs, r_cg=short.r_cg_from_q, sigma_r_cg=[4e-3] * 3, estimator=short.estimator("smoothed"))
    pooling = result.pooling
    assert pooling.between_mountings[0] > 2 * pooling.between_runs[0] / np.sqrt(2)
    assert (np.abs(result.inertia - short.inertia) < 2 * pooling.half_width).all()
    assert [run["mounting"] for run in result.to_dict()["runs"]] == list("AABBCC")
    centre = Source("r_cg", "r_cg", "bias", "cg", np.full(3, 4e-3))
    declared = dataclasses.replace(short, sources=(centre,))
    common = np.array(result.diagnostics["standard_uncertainty_from_cg"])
    varying = with_declared_sources(result, runs, declared, redrawn=["r_cg"], trials=2000)
    # drawn anew by three mountings its variance is a third, and the scatter holds it already
    np.testing.assert_allclose(varying.pooling.from_redrawn_sources[0], common[0] / np.sqrt(3), rtol=0.05)
    assert varying.standard_uncertainty[0] < result.standard_uncertainty[0]
    np.testing.assert_allclose(
        varying.standard_uncertainty[0],
        max(pooling.from_scatter[0], varying.pooling.predicted_standard_uncertainty[0]),
        rtol=0.01,
    )


def test_scatter_beyond_the_residuals_is_said(generator):
    _, as_predicted = pooled(OWN * generator.normal(0, 1, (8, 6)), [None] * 8)
    _, wider = pooled(OWN * generator.normal(0, 6, (8, 6)), [None] * 8)
    assert pooled_scatter_verdict(as_predicted).describes
    assert "more than it predicts" in pooled_scatter_verdict(wider).text
    assert pooled_scatter_verdict(dataclasses.replace(wider, residual_degrees_of_freedom=np.full(6, 20.0))) is None
    assert pooled_scatter_verdict(pooled(np.ones((1, 6)), [None])[1]) is None


@pytest.mark.parametrize("wrong", ["r_cg", [1], [""], 3])
def test_names_of_sources_drawn_by_mounting_are_a_list(preset, wrong):
    document = dict(preset.document) | {"recording": {"drawn_by_mounting": wrong}}
    with pytest.raises(ExperimentError, match=r"drawn_by_mounting is .*: write a list of names of"):
        Experiment.from_dict(document)


def test_the_command_says_what_is_wrong_with_mountings(tmp_path, capsys):
    for text, words in (("A,B", "names 2 mountings for 1 runs"), ("A,,", "is 'A,,': give a name for each run")):
        arguments = ["identify", "run.mcap", "--experiment", "barreto2016", "--mounting", text]
        assert main([*arguments, "--out", str(tmp_path / "out")]) == 2
        assert words in capsys.readouterr().err
        assert not (tmp_path / "out").exists()


def test_a_single_run_has_no_scatter_in_its_budget(generator):
    _, single = pooled(generator.normal(size=(1, 6)), [None])
    single = dataclasses.replace(single, from_residuals=np.diag(generator.uniform(size=6)))
    assert [row.error for row in type_a_rows(single)] == ["residuals"]


def test_names_of_mountings_are_checked(short):
    run = simulate(silenced(short), "T1").run
    assert mounting_names(" A, B ,A") == ("A", "B", "A")
    with pytest.raises(RunError, match="--mounting is 'A,,B': give a name for each run"):
        mounting_names("A,,B")
    with pytest.raises(RunError, match="--mounting names 2 mountings for 1 runs: give one name per run"):
        labelled([run], ("A", "B"))
    other = dataclasses.replace(run, mounting="A")
    with pytest.raises(RunError, match="simulated T1 does not name its mounting, others do: name one for every run"):
        labelled([run, other], None)
    assert [labelled_run.mounting for labelled_run in labelled([run, other], ("B", "C"))] == ["B", "C"]


REMOUNTED = 3e-4
"""Standard uncertainty of r_CG on each axis, which each mounting draws [m]."""


@pytest.fixture(scope="module")
def remounted():
    """Two runs of each of three mountings."""
    shifts = np.random.default_rng([77, 1]).normal(0, REMOUNTED, (3, 3))
    return [measure(k, seconds=10, drawn=0, mounted=tuple(shifts[k // 2])) for k in range(6)]


def named_truly(runs, folder, method, names):
    """The tensor of runs whose mountings are named, with r_CG declared as what each draws."""
    declared = [laboratory_files.source("r_cg", "r_cg", "bias", [REMOUNTED] * 3)]
    return identified_files(runs, folder, method, declared, {"drawn_by_mounting": ["r_cg"]}, mountings=names)


@pytest.mark.slow  # of a body inside the edge: the last test here
def test_a_possible_tensor_knows_what_mountings_draw_too(tmp_path, few_draws, unjudged):
    """A plate's tensor lies on the edge of what bodies have: half of all estimates are moved to a possible one."""
    shifts = np.random.default_rng([77, 1]).normal(0, REMOUNTED, (3, 3))
    plate = np.diag([0.30, 0.02, 0.32])
    runs = [measure(k, seconds=10, drawn=0, inertia=plate, mounted=tuple(shifts[k // 2])) for k in range(6)]
    result = named_truly(runs, tmp_path, "source", list("AABBCC"))
    assert result.admissible is not None
    assert result.warnings == ()


@pytest.mark.slow  # two runs of each: below
def test_mountings_whose_centres_differ_are_no_error_of_the_rig(tmp_path, few_draws):
    """The base turns about a point at rest, from which each mounting has another distance, too."""
    shifts = np.random.default_rng([77, 0]).normal(0, REMOUNTED, (3, 3))
    runs = [measure(k, seconds=10, drawn=0, mounted=tuple(shifts[k])) for k in range(3)]
    assert named_truly(runs, tmp_path, "source", list("ABC")).consistency == ()


@pytest.mark.parametrize(
    "method", ["source", *(pytest.param(name, marks=pytest.mark.slow) for name in ("gls", "joint"))]
)
def test_names_of_mountings_are_silent_if_true_and_left_out_if_wrong(
    tmp_path, few_draws, remounted, method, monkeypatch
):
    def named(names):
        return named_truly(remounted, tmp_path, method, names)

    def holds(result):
        return (np.abs(result.inertia - remounted[0].truth) < np.ptp(result.interval95, axis=1) / 2).all()

    true = named(list("AABBCC"))
    monkeypatch.setattr("identify.identification.judged", not_judged)
    wrong, without = named(list("ABCABC")), named(None)
    assert true.warnings == ()
    assert true.consistency == ()
    assert holds(true)
    assert holds(wrong)
    assert holds(without)
    if method == "gls":  # whose weights hardly let r_CG act
        return
    (text,) = wrong.warnings
    assert text.startswith("the names of the mountings do not match the scatter: ")
    assert "they are left out: correct them, or name none" in text
    np.testing.assert_array_equal(wrong.interval95, without.interval95)
    assert "name the mountings" in without.warnings[0]
    assert {run.mounting for run in wrong.runs} == {None}

"""Type A of pooled runs: closed forms of balanced repeats, coverage by simulation, and what a user can do wrong."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import t as student

from identify.estimators.type_a import Repeat, pooling
from identify.identification import identify
from identify.signals.run import RunError
from uq.campaign.simulation import simulate
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.document import ExperimentError
from uq.identification.run_scatter import pooled_scatter_verdict
from uq.identification.systematic_errors import with_declared_sources
from uq.recorded.mounting import labelled, names
from uq.sources.source import Source

NORMAL = np.diag([400.0, 300, 300, 350, 300, 400])
OWN = np.array([1.0, 0.5, 0.5, 0.8, 0.5, 1.0])
"""Standard uncertainty of one run from its residuals."""
THREE_BY_THREE = ["A", "A", "A", "B", "B", "B", "C", "C", "C"]


def pooled(tensors, mountings):
    """Runs of equal weight and motion: the pooled tensor is their mean."""
    mean, count = tensors.mean(axis=0), len(tensors)
    repeats = [
        Repeat(NORMAL @ (tensor - mean), tensor, OWN, alone=True, mounting=name)
        for tensor, name in zip(tensors, mountings, strict=True)
    ]
    return mean, pooling(repeats, np.linalg.inv(count * NORMAL), np.diag(OWN**2) / count, np.full(6, 1000.0))


def test_equal_runs_scatter_as_their_mean_does(generator):
    tensors = generator.normal(0, 3, (5, 6))
    _, pooling = pooled(tensors, [None] * 5)
    deviation = tensors.std(axis=0, ddof=1)
    np.testing.assert_allclose(pooling.from_scatter, deviation / np.sqrt(5))
    np.testing.assert_allclose(pooling.between_runs, deviation)
    assert (pooling.repeat_degrees_of_freedom, pooling.scatter_degrees_of_freedom, pooling.mountings) == (4, 4, 0)
    assert pooling.between_mountings is None
    np.testing.assert_allclose(pooling.half_width, student.ppf(0.975, 4) * deviation / np.sqrt(5))


def test_mountings_scatter_as_their_means_do(generator):
    tensors = generator.normal(0, 1, (9, 6)) + np.repeat(generator.normal(0, 5, (3, 6)), 3, axis=0)
    _, pooling = pooled(tensors, THREE_BY_THREE)
    groups = tensors.reshape(3, 3, 6)
    means = groups.mean(axis=1).std(axis=0, ddof=1)
    np.testing.assert_allclose(pooling.between_mountings, means)
    np.testing.assert_allclose(pooling.from_scatter, means / np.sqrt(3))
    np.testing.assert_allclose(pooling.between_runs, np.sqrt(groups.var(axis=1, ddof=1).mean(axis=0)))
    assert (pooling.repeat_degrees_of_freedom, pooling.scatter_degrees_of_freedom, pooling.mountings) == (6, 2, 3)
    content = pooling.to_dict()
    assert content["between_mountings"]["I11"] == pytest.approx(means[0])
    assert content["coverage_factor"]["I11"] == pytest.approx(student.ppf(0.975, 2))


def test_one_mounting_of_all_runs_is_none(generator):
    tensors = generator.normal(0, 3, (4, 6))
    _, named = pooled(tensors, ["A"] * 4)
    _, plain = pooled(tensors, [None] * 4)
    np.testing.assert_array_equal(named.half_width, plain.half_width)


@pytest.mark.parametrize("laboratories", [200, pytest.param(1000, marks=pytest.mark.study)])
@pytest.mark.parametrize(("of_mounting", "of_run", "most"), [(5.0, 2.0, 0.95), (0.0, 0.0, 1.0)])
def test_intervals_of_three_mountings_of_three_runs_cover(of_mounting, of_run, most, laboratories):
    """Six components each, which are independent here: of 1,000 laboratories the binomial standard error is 0.28 %.

    With scatter 95 % exactly, but for the residuals' floor: the limits are five standard errors off, a false alarm of
    1e-6. Where nothing lies between runs and mountings, the interval is the wider of two and covers more.
    """
    rng, covered, ignored = np.random.default_rng(11), [], []
    within = 5 * np.sqrt(0.95 * 0.05 / (6 * laboratories))
    for _ in range(laboratories):
        tensors = rng.normal(0, np.hypot(OWN, of_run), (9, 6)) + np.repeat(
            rng.normal(0, of_mounting, (3, 6)), 3, axis=0
        )
        mean, pooling = pooled(tensors, THREE_BY_THREE)
        covered.append(np.abs(mean) <= pooling.half_width)
        ignored.append(np.abs(mean) <= pooled(tensors, [None] * 9)[1].half_width)
    assert 0.95 - within < np.mean(covered) <= most + within
    if of_mounting:
        assert np.mean(ignored) < 0.85  # the same runs without the labels: repeats are no remountings


def test_runs_of_a_rig_scatter_by_mounting(short, unjudged):
    """A centre of gravity that is another in each mounting shows between them, and is not taken for the runs' own."""
    short = dataclasses.replace(short, inertia=np.array([0.38, 0.0, 0.0, 0.25, 0.0, 0.35]))  # far from what no body has
    sources = [dataclasses.replace(s, sigma=0.5 * s.sigma) for s in short.sources if s.kind == "precision"]
    clean = simulate(dataclasses.replace(short, sources=()), "T2").run
    rng, sigma, runs = np.random.default_rng(7), {s.name: s.sigma for s in sources}, []
    for mounting, shift in zip("ABC", rng.normal(0, 4e-3, (3, 3)), strict=True):
        for _ in range(2):
            noise = [sigma[f"{of}_precision"] * rng.standard_normal(clean.omega.shape) for of in ("F", "M", "omega")]
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
    common = with_declared_sources(result, runs, declared, trials=2000)
    varying = with_declared_sources(result, runs, declared, redrawn=["r_cg"], trials=2000)
    # drawn anew by three mountings its variance is a third, and the scatter holds it already
    np.testing.assert_allclose(
        varying.pooling.from_redrawn_sources[0], common.budget["r_cg"][0] / np.sqrt(3), rtol=0.05
    )
    assert varying.standard_uncertainty[0] < common.standard_uncertainty[0]
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


def test_names_of_mountings_are_checked(short):
    run = simulate(dataclasses.replace(short, sources=()), "T1").run
    assert names(" A, B ,A") == ("A", "B", "A")
    with pytest.raises(RunError, match="--mounting is 'A,,B': give a name for each run"):
        names("A,,B")
    with pytest.raises(RunError, match="--mounting names 2 mountings for 1 runs: give one name a run"):
        labelled([run], ("A", "B"))
    other = dataclasses.replace(run, mounting="A")
    with pytest.raises(RunError, match="simulated T1 does not name its mounting, others do: name one for every run"):
        labelled([run, other], None)
    assert [labelled_run.mounting for labelled_run in labelled([run, other], ("B", "C"))] == ["B", "C"]

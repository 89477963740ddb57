"""The estimate from sums over blocks: that of the whole run, as ``inertia identify`` has it."""

import copy
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from identify.identification import identify
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from rig.bags.growing_file import GrowingFile
from rig.mcap.message_definitions import IMU, WRENCH
from tests.helpers import recordings
from uq.experiment.experiment import Experiment
from uq.experiment.undeclared_table import UndeclaredTable
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.recorded_sums import ELEMENTS, FEATURES
from uq.runs.identification.systematic_errors import nodes_of, problem_of, propagated
from uq.runs.identification.undeclared import with_undeclared
from uq.runs.live.estimate_lines import block_of, line_of, missed
from uq.runs.live.growing_run import GrowingRun
from uq.runs.live.live_estimate import LiveEstimate, agreeing, estimated, fit, sources_in
from uq.runs.live.running_sums import RunningSums
from uq.runs.recorded.load_run import load_run


@pytest.fixture(scope="module")
def ten_seconds():
    return Experiment.load(Path(__file__).parents[4] / "uq" / "examples" / "t1-10s.toml")


@pytest.fixture(scope="module")
def signals(ten_seconds):
    return recordings.Signals.of(simulate(ten_seconds, seed=3))


def sums_of(path, experiment, pieces=1):
    """The sums of a file that is handed over in so many pieces."""
    growing = GrowingFile(path, {WRENCH: None, IMU: None})
    estimator, nodes = experiment.estimator(), nodes_of(sources_in(experiment))
    delay = float(abs(nodes).max())
    run = GrowingRun(Path(path), experiment.recording, estimator, ("/wrench", "/imu"), delay=delay)
    sums, data = RunningSums(estimator, nodes), Path(path).read_bytes()
    growing.path = Path(f"{path}.growing")
    for k in range(1, pieces + 1):
        growing.path.write_bytes(data[: len(data) * k // pieces])
        run.add(growing.take())
        for block in run.blocks(growing.definitions.metadata, ended=growing.ended):
            sums.add(block)
    assert growing.ended
    assert run.troubles == []
    return sums


@pytest.fixture(scope="module")
def common(tmp_path_factory, signals):
    return recordings.write(tmp_path_factory.mktemp("common") / "run.mcap", signals)


@pytest.fixture(scope="module")
def sums(ten_seconds, common):
    return sums_of(common, ten_seconds)


@pytest.fixture(scope="module")
def late_sums(ten_seconds, common):
    return sums_of(common, with_delay(ten_seconds))


def test_blocks_join_without_a_seam(ten_seconds, common):
    """Common, uniform instants: the same numbers as least squares on all samples, but for rounding."""
    sums = sums_of(common, ten_seconds, pieces=7)
    run = load_run(common)
    spec = ten_seconds.estimator()
    expected = whole(run, ten_seconds)
    assert sums.products[0, 0] == len(run.t) - spec.lost(run.rate)
    assert sums.lines.sum() == sums.products[0, 0]
    np.testing.assert_allclose(
        fit(sums, ten_seconds.r_cg_from_q).inertia, expected.inertia, rtol=0, atol=1e-12 * expected.inertia.max()
    )


def with_delay(experiment):
    """An experiment that declares a delay of the gyro."""
    delay = {"name": "delay", "target": "omega", "kind": "delay", "sigma": "2 ms", "group": "imu"}
    document = dict(experiment.document)
    return Experiment.from_dict({**document, "source": [*document["source"], delay]})


def test_the_uncertainty_is_about_that_of_the_whole_run(ten_seconds, common, late_sums):
    """Other windows of frequency, at some 30 degrees of freedom; fewer draws of the sources, a delay among them."""
    experiment = with_delay(ten_seconds)
    live = estimated(late_sums, experiment)
    final, sources = declared(common, experiment)
    np.testing.assert_allclose(live.type_a, final.pooling.half_width, rtol=0.15)
    np.testing.assert_allclose(live.of_sources, sources, rtol=0.08)
    half = np.hypot(final.pooling.half_width, sources)
    np.testing.assert_allclose(live.half_width, half, rtol=0.15)
    assert not live.undetermined
    assert {"delay", "r_cg"} <= set(live.largest_source)


def test_sensors_of_two_rates(ten_seconds, signals, tmp_path):
    """A low-pass and splines beyond each block's ends: the same but for the grid, a hundredth of the uncertainty."""
    path = recordings.write(tmp_path / "run.mcap", signals, every=2)
    final = whole(load_run(path), ten_seconds)
    live = fit(sums_of(path, ten_seconds), ten_seconds.r_cg_from_q)
    error = (live.inertia - final.inertia) / np.sqrt(np.diag(final.covariance))
    assert np.abs(error).max() < 0.01


def test_a_gap_is_left_out(ten_seconds, signals, tmp_path):
    """By rounding of an instant at the gap's edge a row more or less counts, 1/√4000 of what all rows scatter."""
    lost = (signals.t < 4.4) | (signals.t > 4.7)
    part = recordings.Signals(*(getattr(signals, f.name)[lost] for f in dataclasses.fields(signals)))
    path = recordings.write(tmp_path / "run.mcap", part)
    sums = sums_of(path, ten_seconds)
    final = whole(load_run(path), ten_seconds)
    live = fit(sums, ten_seconds.r_cg_from_q)
    error = (live.inertia - final.inertia) / np.sqrt(np.diag(final.covariance))
    assert np.abs(error).max() < 0.05
    assert any("gap" in text for text in sums.left_out)
    assert any("gap" in text for text in sums.warnings)


LINES = 50 * np.array([1, 1, 2, 4, 8, 16, 32])
"""Of the lowest bands, after 50 blocks."""


def bands_of(shape, seed):
    """Sums of products of white noise on three axes, by band, each of so large a variance; and their agreement."""
    rng = np.random.default_rng([61, seed])
    noise = [rng.normal(size=(count, 3)) for count in LINES]
    squares = np.array([variance * part.T @ part for variance, part in zip(shape, noise, strict=True)])
    return squares, agreeing(squares, np.repeat(LINES[:, None], 3, axis=1).astype(float), np.ones(len(LINES)))


def test_bands_of_white_noise_agree():
    """Two-sided at 2.5 standard deviations on three axes, a step fails in 3.7 %: 0.93 of the steps are taken.

    200 draws of 9 steps; draws of a whole row fail together: 0.93 ± 0.01.
    """
    taken = np.array([bands_of(np.ones(7), seed)[1] for seed in range(200)])
    few = LINES < 100
    assert (taken[:, few].sum(axis=2) == 1).all()
    steps = [taken[:, b, k].mean() for b in np.flatnonzero(~few) for k in range(b + 1, min(b + 4, 7))]
    assert 0.88 < np.mean(steps) < 0.97


def test_bands_of_coloured_noise_stay_apart():
    """Power as 1/f: neighbours differ by ln 2, three standard deviations even of the lowest band that may ask."""
    apart = [bands_of(2.0 ** -np.arange(7), seed)[1] for seed in range(100)]
    assert np.mean([taken.sum() - len(LINES) for taken in apart]) < 0.2


@pytest.mark.parametrize("power", [0.1, 0.2, 0.3])
def test_noise_that_falls_too_slowly_to_be_told_costs_little(power):
    """The variance of a band of 200 lines: at most a tenth too small, 5 % of the uncertainty. 300 draws: ± 0.6 %."""
    shape, means = 2.0 ** (-power * (np.arange(7) - 3)), []
    for seed in range(300):
        squares, taken = bands_of(shape, seed)
        means.append(np.einsum("k,kaa->", taken[3], squares) / (3 * LINES[taken[3]].sum()))
    assert 0.9 < np.mean(means) < 1.0


def test_the_variance_scatters_as_its_degrees_of_freedom_say(ten_seconds, sums):
    """Drawn white noise at the spectrum of a motion of 100 s: the variance is the textbook's, its scatter √(2/freedom).

    300 draws tell the scatter within 4 %. Which bands agree is chance, too, which widens it by some 30 %.
    """
    sums = copy.deepcopy(sums)
    for name in ("products", "spectra", "lines", "gain"):
        setattr(sums, name, 10 * getattr(sums, name))
    wrench = np.arange(13, 19)
    sums.products[:, ELEMENTS:] = sums.products[ELEMENTS:] = sums.spectra[:, wrench] = sums.spectra[:, :, wrench] = 0.0
    rng, drawn = np.random.default_rng(67), []
    for _ in range(300):
        for b in np.flatnonzero(sums.lines):
            noise = rng.normal(size=(3, 3))
            noise = np.tril(noise, -1) + np.diag(np.sqrt(rng.chisquare(sums.lines[b] - np.arange(3))))  # Bartlett
            sums.spectra[b, 16:, 16:] = noise @ noise.T
        drawn.append(fit(sums, ten_seconds.r_cg_from_q))
    variance = np.array([np.diag(each.covariance) for each in drawn])
    freedom = np.array([each.degrees_of_freedom for each in drawn])
    assert (freedom.mean(axis=0) > 1000).all()
    mean = sums.products[0, FEATURES] / sums.products[0, 0]
    features = sums.products[np.ix_(FEATURES, FEATURES)] - sums.products[0, 0] * np.outer(mean, mean)
    normal = np.einsum("fai,fg,gaj->ij", OMEGA_R_OF_FEATURES, features, OMEGA_R_OF_FEATURES)
    np.testing.assert_allclose(variance.mean(axis=0), np.diag(np.linalg.inv(normal)), rtol=0.02)
    scatter = variance.std(axis=0) / variance.mean(axis=0)
    stated = np.sqrt((2 / freedom).mean(axis=0))
    assert (scatter < 1.6 * stated).all(), (scatter, stated)
    assert (scatter > 0.85 * stated).all(), (scatter, stated)


def declared(path, experiment):
    """The whole run's estimate, and half the interval that the declared sources alone leave, each part by itself."""
    run = load_run(path)
    result = dataclasses.replace(whole(run, experiment), admissible=None)  # its covariance would hold the centre's
    errors = sum(propagated(problem_of(result, [run], experiment), trials=4000).alone.values())
    half = (np.quantile(errors, 0.975, axis=0) - np.quantile(errors, 0.025, axis=0)) / 2
    return result, np.hypot(half, 1.96 * result.contributions["r_cg"])


def test_undeclared_errors_are_those_of_identify(ten_seconds, common, sums, late_sums):
    """But for cross-talk, delay and mounting, which the sums do not tell, whether a delay is declared or not."""
    table = UndeclaredTable(cross_talk=None, delay=None, mounting_frequency=None, mass=None)
    experiment = dataclasses.replace(ten_seconds, undeclared=table)
    run = load_run(common)
    result = with_undeclared(dataclasses.replace(whole(run, experiment), by_held_errors=None), [run], experiment)
    live = estimated(sums, experiment).undeclared
    np.testing.assert_allclose(live, 2 * result.undeclared.standard_uncertainty[4:], rtol=0.02)
    late = dataclasses.replace(with_delay(ten_seconds), undeclared=table)
    np.testing.assert_allclose(estimated(late_sums, late).undeclared, live, rtol=1e-3)


def whole(run, experiment):
    return identify(
        run, r_cg=experiment.r_cg_from_q, sigma_r_cg=experiment.sigma_r_cg, estimator=experiment.estimator()
    )


def of(type_a, of_sources, undetermined=()):
    half = np.hypot(type_a, of_sources)
    return LiveEstimate(
        seconds=40.0, inertia=np.ones(6), standard_uncertainty=half / 2, interval95=np.stack([1 - half, 1 + half], axis=1),
        type_a=type_a, of_sources=of_sources, largest_source=("r_cg",) * 6, undeclared=np.full(6, 4.5e-3),
        undetermined=undetermined,
    )  # fmt: skip


def test_noise_falls_with_the_root_of_time_and_sources_stay():
    """Half 5 from noise, 3 from sources: a target of 4 leaves √7 to noise, which takes 25/7 of the time."""
    estimate = of(np.full(6, 5e-3), np.full(6, 3e-3))
    assert estimate.seconds_to(4e-3) == pytest.approx(40.0 * (25 / 7 - 1))
    assert estimate.seconds_to(6e-3) == 0.0
    assert estimate.forbids(4e-3) is None
    assert estimate.forbids(2.9e-3) == ("r_cg", "I11", 3e-3)
    assert estimate.seconds_to(2.9e-3) == np.inf
    assert "about 103 s more" in line_of(estimate, 4e-3)
    assert "no duration reaches it" in line_of(estimate, 2.9e-3)
    assert "r_cg" in block_of(estimate, 2.9e-3, [])[-1]
    assert "reached" in line_of(estimate, 6e-3)
    assert "undeclared" not in line_of(estimate, 6e-3)
    assert line_of(estimate, 4e-3).endswith("; undeclared errors at typical size add at least ± 4.5 to I11 at any time")


def test_what_the_motion_does_not_determine_has_no_figure():
    estimate = of(np.full(6, 5e-3), np.zeros(6), ("I33",))
    assert np.isinf(estimate.half_width).all()
    assert estimate.seconds_to(1.0) == np.inf
    assert "does not yet determine I33" in line_of(estimate, None)


def test_a_target_that_the_whole_recording_misses_is_named():
    interval95 = np.array([[0.38, 0.384], [-1e-3, 1e-3], [-2e-3, 2e-3], [0.01, 0.0222], [0, 0], [0.37, 0.38]])
    assert missed(interval95, 6.1001e-3) == ""
    assert missed(interval95, 5e-3).startswith("the target ± 5.0 g·m² at 95 %, which the estimate while recording had")
    assert "I22 has ± 6.1;" in missed(interval95, 5e-3)
    assert missed(interval95, 1.0, "the runs contradict it").endswith("of the whole recording: the runs contradict it")
    assert "I33 has ± ∞;" in missed(np.vstack([interval95[:5], [0.0, np.inf]]), 5e-3)

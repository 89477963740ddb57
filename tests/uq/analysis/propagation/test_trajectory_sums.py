"""Sums over a run in pieces: of any duration by the same code, and those of the whole run at once."""

import dataclasses

import jax
import numpy as np
import pytest

from identify.signals.differentiate import derivative
from uq.analysis.propagation import trajectory_sums as pieces
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.trial_setup import fitted_estimators, platform_of, true_motion
from uq.monte_carlo.gram_sums.error_maps import WrenchBasis, true_elements
from uq.monte_carlo.gram_sums.noise_moments import run_moments
from uq.plan.measurement.required_duration import lasting
from uq.sources.noise_filters import WHITE


@pytest.fixture(scope="module")
def many():
    """Ten seconds with a delay, drifts and errors of the rig, of two estimators."""
    return Experiment.load("uq/examples/many-errors.toml")


def summed(experiment, spec):
    count = round(spec.duration * spec.rate)
    taps = [e.taps for e in fitted_estimators(experiment.estimators, spec, count)]
    columns = WrenchBasis.for_sources(experiment.sources)
    given = experiment.body, platform_of(experiment, spec), taps, columns, True
    return pieces.run_sums(spec.trajectory, count, spec.rate, *given)


def noise_free(experiment, spec):
    """Motion, wrench and other columns, estimators' taps, and 1 for samples where all of these have a derivative."""
    motion = jax.tree.map(np.asarray, true_motion(experiment, spec))
    wrench = np.asarray(WrenchBasis.for_sources(experiment.sources).sampled(experiment.body, motion))
    taps = [np.asarray(e.taps) for e in fitted_estimators(experiment.estimators, spec, len(motion.t))]
    reach, number = max(map(len, taps)), np.arange(len(motion.t))
    return motion, wrench, taps, ((number >= reach) & (number < len(number) - reach)).astype(float)


def alpha_of(omega, taps):
    return np.pad(derivative(omega, taps), ((0, 0), (len(taps),) * 2))


def test_pieces_add_up_to_the_whole_run(many, monkeypatch):
    """Against the true motion in one array; in a unit of the largest of each kind, 1e-11 is rounding."""
    spec = many.trajectories["T1"]
    monkeypatch.setattr(pieces, "PIECE", 1000)
    pieces._moved.clear_cache()  # its code has the size of a piece
    sums, moments, peaks = summed(many, spec)
    pieces._moved.clear_cache()
    motion, wrench, taps, valid = noise_free(many, spec)
    alphas = [alpha_of(motion.omega, h) for h in taps]
    whole = run_moments(np.concatenate([motion.omega, *alphas, wrench[:6]]), valid, taps)

    def agree(computed, expected):
        np.testing.assert_allclose(computed, expected, atol=1e-11 * np.abs(expected).max())

    agree(moments.linear[WHITE], whole.linear[WHITE])
    agree(moments.quadratic[WHITE, WHITE], whole.quadratic[WHITE, WHITE])
    columns = np.concatenate([wrench, np.ones((1, len(motion.t)))])
    for k, alpha in enumerate(alphas):
        own = sums.of_estimator(k).at(0.0)
        phi = np.concatenate([true_elements(motion.omega, alpha, motion.t), alpha]) * valid
        agree(own.gram, phi @ phi.T)
        agree(own.wrench, phi @ columns.T)
    signals = {"F": wrench[:3], "M": wrench[3:6], "omega": motion.omega}
    for name, signal in signals.items():
        np.testing.assert_allclose(peaks.largest[name], np.abs(signal).max(axis=1), rtol=1e-12)
        rms = np.sqrt(np.mean(np.diff(signal) ** 2, axis=1))
        np.testing.assert_allclose(peaks.moves[name], rms, rtol=1e-9)


def test_a_delays_derivatives_are_those_of_delayed_runs(many):
    """Second differences over ±1 ms of the sums of a gyro that is late; their own error is of the square of 1 ms."""
    spec, h = many.trajectories["T1"], 1e-3
    sums, *_ = summed(many, spec)
    motion, wrench, taps, valid = noise_free(many, spec)

    def late(delay, own):
        omega = np.asarray(jax.vmap(spec.trajectory.omega, out_axes=1)(motion.t - delay))
        alpha = alpha_of(omega, own)
        phi = np.concatenate([true_elements(omega, alpha, motion.t), alpha]) * valid
        return phi @ phi.T, phi @ wrench.T

    for k, own in enumerate(taps):
        slope = sums.of_estimator(k).derivative()
        orders = slope.at(0.0), slope.derivative().at(0.0)
        for part in range(2):
            before, now, after = (late(delay, own)[part] for delay in (-h, 0.0, h))
            differences = (after - before) / (2 * h), (after - 2 * now + before) / h**2
            for order, expected in zip(orders, differences, strict=True):
                got = order[part][:, : expected.shape[1]]
                np.testing.assert_allclose(got, expected, atol=2e-4 * np.abs(expected).max())


def test_another_duration_compiles_nothing(brief, monkeypatch):
    """The law visits other numbers of samples by the code that is there: nothing is traced again."""
    plain = dataclasses.replace(brief, estimators=brief.estimators[:1])
    spec = brief.trajectories["T1"]
    summed(plain, spec)
    monkeypatch.setattr(pieces, "sample", lambda *_, **__: pytest.fail("traced again"))
    sums, *_ = summed(plain, dataclasses.replace(lasting(spec, 31.3), rate=390.0))
    assert sums.gram[0, 0, 0, 0] == round(31.3 * 390) - 2

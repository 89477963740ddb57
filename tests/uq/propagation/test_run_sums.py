"""Sums over a run in pieces: of any duration by the same code, and those of the whole run at once."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from uq.campaign.trial_setup import fitted_estimators, platform_of, true_motion
from uq.experiment.experiment import Experiment
from uq.gram_sums.error_maps import Columns
from uq.gram_sums.sums_over_samples import alphas_of, moments_of_signals
from uq.planning.required_duration import lasting
from uq.propagation import run_sums as pieces
from uq.trials.trial import valid_samples


@pytest.fixture(scope="module")
def many():
    """Ten seconds with a delay, drifts and errors of the rig, of two estimators."""
    return Experiment.load("docs/experiments/many-errors.toml")


def summed(experiment, spec):
    count = round(spec.duration * spec.rate)
    taps = [e.taps for e in fitted_estimators(experiment.estimators, spec, count)]
    columns = Columns.of(experiment.sources)
    given = experiment.body, platform_of(experiment, spec), taps, columns, True
    return pieces.run_sums(spec.trajectory, count, spec.rate, *given)


def test_pieces_add_up_to_the_whole_run(many, monkeypatch):
    """Against the true motion in one array; in a unit of the largest of each kind, 1e-12 is rounding."""
    spec = many.trajectories["T1"]
    sums, peaks = summed(many, spec)
    motion, columns = true_motion(many, spec), Columns.of(many.sources)
    estimators = fitted_estimators(many.estimators, spec, len(motion.t))
    taps, valid = [e.taps for e in estimators], jnp.asarray(valid_samples(len(motion.t), estimators))
    wrench = columns.sampled(many.body, motion)
    signals = jnp.concatenate([motion.omega, alphas_of(motion.omega, taps), wrench[:6]])
    whole = jax.jit(moments_of_signals)(signals, valid, taps)
    for name in ("sums", "totals", "correlated"):
        expected = np.asarray(getattr(whole, name))
        np.testing.assert_allclose(getattr(sums.moments, name), expected, atol=1e-12 * np.abs(expected).max())
    alphas = np.asarray(alphas_of(motion.omega, taps)) * np.asarray(valid)
    true = np.asarray(sums.noise_free.sums[0].wrench[15:])
    expected = alphas @ np.asarray(wrench).T
    np.testing.assert_allclose(true, expected, atol=1e-12 * np.abs(expected).max())
    of_signals = {"F": wrench[:3], "M": wrench[3:6], "omega": motion.omega}
    for name, signal in of_signals.items():
        np.testing.assert_allclose(peaks.largest[name], np.abs(signal).max(axis=1), rtol=1e-12)
        rms = np.sqrt(np.mean(np.diff(signal) ** 2, axis=1))
        np.testing.assert_allclose(peaks.moves[name], rms, rtol=1e-9)


def test_a_delays_derivatives_are_those_of_delayed_runs(many):
    """Second differences over ±1 ms of the sums of a gyro that is late; their own error is of the square of 1 ms."""
    spec = many.trajectories["T1"]
    sums, _ = summed(many, spec)
    motion, h = true_motion(many, spec), 1e-3
    count = len(motion.t)
    estimators = fitted_estimators(many.estimators, spec, count)
    valid = valid_samples(count, estimators)
    wrench = np.asarray(Columns.of(many.sources).sampled(many.body, motion))

    def late(delay):
        omega = np.asarray(jax.vmap(spec.trajectory.omega, out_axes=1)(motion.t - delay)) * valid
        return omega @ (wrench * valid).T

    before, now, after = (late(delay) for delay in (-h, 0.0, h))
    of_omega = slice(1, 4)
    for order, expected in ((1, (after - before) / (2 * h)), (2, (after - 2 * now + before) / h**2)):
        got = np.asarray(sums.noise_free.sums[order].wrench[of_omega])
        np.testing.assert_allclose(got, expected, atol=2e-4 * np.abs(expected).max())


def test_another_duration_compiles_nothing(brief, monkeypatch):
    """The law visits other numbers of samples by the code that is there: nothing is traced again."""
    plain = dataclasses.replace(brief, estimators=brief.estimators[:1])
    spec = brief.trajectories["T1"]
    summed(plain, spec)
    for name in ("sample", "sums_of_piece"):
        monkeypatch.setattr(pieces, name, lambda *_, **__: pytest.fail("traced again"))
    sums, _ = summed(plain, dataclasses.replace(lasting(spec, 31.3), rate=390.0))
    assert sums.noise_free.sums[0].gram[0, 0] == round(31.3 * 390) - 2

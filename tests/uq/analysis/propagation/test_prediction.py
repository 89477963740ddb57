"""The differentiable prediction against the law of every sample."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.motion.trajectory import sample
from uq import law
from uq.analysis.propagation.prediction import Prediction, predicted
from uq.analysis.propagation.trajectory_sums import jerk_of
from uq.experiment.experiment import Experiment


def promised(experiment, name, rate):
    return 3 * np.sqrt(np.diag(predicted(experiment, experiment.trajectories[name], rate, 0.0)[1]))


def agree_in_mean(experiment, name, expected):
    """The law's mean error within 2 % of its largest, and 0.04 g·m²: the differentiator, right to 1e-4 of 380 g·m²."""
    spec = experiment.trajectories[name]
    got, _ = predicted(experiment, spec, 20.0, experiment.estimator("smoothed").alpha_noise_gain(spec.rate))
    np.testing.assert_allclose(got, expected.mean_error, rtol=0, atol=4e-5 + 0.02 * np.abs(expected.mean_error).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["T1", "T2"])
def test_the_promise_is_the_laws(preset, name):
    expected = law(preset, name, "smoothed")[name, "smoothed"].groups["total"]
    np.testing.assert_allclose(promised(preset, name, 20.0), 3 * np.sqrt(np.diag(expected.covariance)), rtol=0.01)
    agree_in_mean(preset, name, expected)


def with_every_kind(preset, scale, delay, mean):
    """The preset with constant errors of more kinds: scale of omega, delay, expected scale of M as given."""
    more = [
        {"name": "scale", "target": "M", "kind": "scale", "sigma": ["0.5 %"] * 3, "group": "x", "mean": [mean] * 3},
        {"name": "scale of omega", "target": "omega", "kind": "scale", "sigma": [scale] * 3, "group": "x"},
        {"name": "delay", "target": "omega", "kind": "delay", "sigma": delay, "group": "x"},
        {"name": "axes", "target": "omega", "kind": "misalignment", "sigma": ["0.3 deg"] * 3, "group": "x"},
        {"name": "drift of F", "target": "F", "kind": "drift", "sigma": ["5 mN/s"] * 3, "group": "x"},
        {"name": "drift of M", "target": "M", "kind": "drift", "sigma": ["0.2 mN*m/s"] * 3, "group": "x"},
    ]
    experiment = Experiment.from_dict({**preset.document, "source": [*preset.document["source"], *more]})
    return experiment, law(experiment, "T2", "smoothed")["T2", "smoothed"].groups["total"]


def test_with_every_kind_of_error(preset):
    experiment, expected = with_every_kind(preset, "0.1 %", "2 ms", "0 %")
    np.testing.assert_allclose(promised(experiment, "T2", 20.0), 3 * np.sqrt(np.diag(expected.covariance)), rtol=0.02)


def test_expectations_and_squares_of_errors_shift_the_mean(preset):
    """The law has +3.8 g·m² of I11 from a scale of 1 % expected of M, +0.95 from 5 % of omega, −1.7 from 10 ms."""
    for of_experiment in (("5 %", "1 ms", "0 %"), ("0.1 %", "10 ms", "0 %"), ("0.1 %", "1 ms", "1 %")):
        experiment, expected = with_every_kind(preset, *of_experiment)
        assert np.abs(expected.mean_error).max() > 0.9e-3
        agree_in_mean(experiment, "T2", expected)


def test_a_noisy_gyro(preset):
    def louder(source):
        return (
            dataclasses.replace(source, sigma=10 * np.asarray(source.sigma))
            if source.name == "omega_precision"
            else source
        )

    experiment = dataclasses.replace(preset, sources=tuple(map(louder, preset.sources)))
    expected = law(experiment, "T1", "smoothed")["T1", "smoothed"].groups["total"]
    np.testing.assert_allclose(promised(experiment, "T1", 20.0), 3 * np.sqrt(np.diag(expected.covariance)), rtol=0.03)
    assert expected.mean_error[5] < -5e-3  # more than 3σ
    agree_in_mean(experiment, "T1", expected)


@pytest.mark.slow
def test_its_gradient_is_that_of_differences(short):
    spec = short.trajectories["T2"]
    prediction = Prediction.of(short, spec)
    t = jnp.arange(0.0, spec.duration, 1 / 20.0)

    def width(scale):
        faster = eqx.tree_at(lambda x: x.angular_acceleration, spec.trajectory, 4.0 * scale)
        motion = sample(faster, t, r_cg_from_still=short.r_cg_from_omb, gravity=np.array(9.81))
        mean_error, covariance = prediction.moments(motion, jerk_of(faster, t), 98.0)
        return jnp.log(jnp.trace(covariance) + mean_error @ mean_error)

    unit, h = jnp.array(1.0), 1e-4
    np.testing.assert_allclose(jax.grad(width)(unit), (width(unit + h) - width(unit - h)) / (2 * h), rtol=1e-5)

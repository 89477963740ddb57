"""The differentiable prediction against the law of every sample."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.motion.trajectory import sample
from uq import law
from uq.experiment.experiment import Experiment
from uq.propagation.prediction import Prediction, jerk_of, predicted_covariance


def promised(experiment, name, rate):
    return 3 * np.sqrt(np.diag(predicted_covariance(experiment, experiment.trajectories[name], rate)))


@pytest.mark.parametrize("name", ["T1", "T2"])
def test_the_promise_is_the_laws(preset, name):
    expected = law(preset, name, "smoothed")[name, "smoothed"].groups["total"]
    np.testing.assert_allclose(promised(preset, name, 20.0), 3 * np.sqrt(np.diag(expected.covariance)), rtol=0.01)


def test_with_every_kind_of_error(preset):
    document = dict(preset.document)
    more = [
        {"name": "scale", "target": "M", "kind": "scale", "sigma": ["0.5 %"] * 3, "group": "x"},
        {"name": "delay", "target": "omega", "kind": "delay", "sigma": "2 ms", "group": "x"},
        {"name": "axes", "target": "omega", "kind": "misalignment", "sigma": ["0.3 deg"] * 3, "group": "x"},
        {"name": "drift of F", "target": "F", "kind": "drift", "sigma": ["5 mN/s"] * 3, "group": "x"},
        {"name": "drift of M", "target": "M", "kind": "drift", "sigma": ["0.2 mN*m/s"] * 3, "group": "x"},
    ]
    experiment = Experiment.from_dict({**document, "source": [*document["source"], *more]})
    expected = law(experiment, "T2", "smoothed")["T2", "smoothed"].groups["total"]
    np.testing.assert_allclose(promised(experiment, "T2", 20.0), 3 * np.sqrt(np.diag(expected.covariance)), rtol=0.02)


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


def test_its_gradient_is_that_of_differences(short):
    spec = short.trajectories["T2"]
    prediction = Prediction.of(short, spec)
    t = jnp.arange(0.0, spec.duration, 1 / 20.0)

    def width(scale):
        faster = eqx.tree_at(lambda x: x.angular_acceleration, spec.trajectory, 4.0 * scale)
        motion = sample(faster, t, r_cg_from_still=short.r_cg_from_omb, gravity=np.array(9.81))
        jerk = jerk_of(dataclasses.replace(spec, trajectory=faster), motion)
        return jnp.log(jnp.trace(prediction.covariance(motion, jerk)))

    unit, h = jnp.array(1.0), 1e-4
    np.testing.assert_allclose(jax.grad(width)(unit), (width(unit + h) - width(unit - h)) / (2 * h), rtol=1e-5)

"""The joint estimate: exact without noise, honest with it, and aware of what a motion cannot tell."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from joint_lab import BAND, shortened

from identify.centre_result import Centre
from identify.identification import identify
from identify.in_band import evaluate, in_band, low_pass
from identify.joint_jacobian import linearised
from identify.joint_model import COUNT, SLICES, Model, kinematics, residuals, unknowns
from identify.priors import Alignment
from identify.run import RunError
from uq.simulation import simulate
from uq.sources import Source

DELAY, ROTATION = 7e-3, np.array([0.02, -0.03, 0.015])


@pytest.fixture(scope="module")
def brief():
    """The preset with T1 of 20 s."""
    from uq.experiment import Experiment

    return shortened(Experiment.load("barreto2016"), 20.0)


def imperfect(experiment, *sources):
    """The experiment with only these sources, an IMU that is late and turned, and a gyro's zero."""
    misaligned = (
        Source("late", "omega", "delay", "imu", np.array(0.0), mean=np.array(DELAY)),
        Source("turned", "omega", "misalignment", "imu", np.zeros(3), mean=ROTATION),
        Source("zero", "omega", "bias", "imu", np.zeros(3), mean=np.array([4e-3, -5e-3, 3e-3])),
    )
    return dataclasses.replace(experiment, sources=(*misaligned, *sources))


def calibrated(experiment, sigma=(0.05, *(1.5e-4,) * 3, 0.7, 0.4, 1.4, 0.014, 0.016, 0.019)):
    """A static calibration that is right."""
    values = np.concatenate([[experiment.mass], experiment.r_cg_from_q, np.zeros(6)])
    return Centre(
        values[0], values[1:4], values[4:7], values[7:], np.diag(np.square(sigma)), np.zeros((4, 6)), 18.0, 9.81
    )


def estimate(experiment, run, **options):
    known = {"centre": calibrated(experiment), "gravity": 9.81, "cg_motion": "still"} | options
    return identify(run, estimator=experiment.estimator("smoothed"), method="joint", **known)


@pytest.fixture(scope="module")
def silent_run(brief):
    return simulate(imperfect(brief), "T1").run


def test_a_silent_run_tells_tensor_delay_and_rotation(brief, silent_run):
    """A simulated run with an IMU late by 7 ms and turned by 2.2°; the low-pass is flat within 1e-7."""
    result = estimate(brief, silent_run)
    np.testing.assert_allclose(result.inertia, brief.inertia, atol=5e-7 * brief.inertia.max())
    np.testing.assert_allclose(result.delay.value, [DELAY], atol=1e-8)
    np.testing.assert_allclose(result.rotation.value, ROTATION, atol=1e-6)
    np.testing.assert_allclose(result.r_cg, brief.r_cg_from_q, atol=1e-7)
    assert result.mass == pytest.approx(brief.mass, abs=1e-4)
    content = result.to_dict()
    assert content["method"] == "joint"
    assert content["delay"]["estimated"]
    assert content["delay"]["prior_share"] < 1e-6
    np.testing.assert_allclose(content["rotation"]["rotation_vector"], ROTATION, atol=1e-6)
    assert "delay of the IMU: 7.000" in repr(result)


def test_a_delay_of_many_samples_is_found(brief):
    """Beyond a quarter of the motion's period, where a start at zero would find another minimum."""
    late = Source("late", "omega", "delay", "imu", np.array(0.0), mean=np.array(0.25))
    run = simulate(dataclasses.replace(brief, sources=(late,)), "T1").run
    result = estimate(brief, run, alignment=Alignment(sigma_delay=0.15))
    np.testing.assert_allclose(result.delay.value, [0.25], atol=1e-6)
    np.testing.assert_allclose(result.inertia, brief.inertia, atol=1e-6 * brief.inertia.max())
    with pytest.raises(RunError, match="beyond what is declared of it|does not converge"):
        estimate(brief, run, alignment=Alignment(sigma_delay=0.02))


@pytest.mark.parametrize("kind", ["still", "accelerometer", "none"])
def test_the_closed_form_derivatives_are_finite_differences(brief, silent_run, generator, kind):
    """Central differences at a point away from zero; sums by trapezes leave 1e-2 in the slow terms' derivatives."""
    specific_force = generator.standard_normal(silent_run.force.shape) * 0.1 + [0, 0, 9.8]
    run = dataclasses.replace(silent_run, specific_force=specific_force)
    rows = in_band(run, BAND, reach=0.05, accelerometer=kind == "accelerometer")
    model = Model(rows, jnp.array([0.0, 0.0, 1.0]), jnp.asarray(9.81), jnp.array([0.1, 0.02, -0.03]), kind)
    theta = 1e-3 * generator.standard_normal(COUNT)
    theta[SLICES["inertia"]] += brief.inertia
    theta[SLICES["mass"]], theta[SLICES["delay"]] = 19.0, 6.1e-3

    def value(theta):
        x = unknowns(jnp.asarray(theta))
        return np.asarray(residuals(model, x, kinematics(model, x)))

    _, jacobian = linearised(model, jnp.asarray(theta))
    for name, part in SLICES.items():
        tolerance = 2e-2 if name in ("gyro_bias", "wander") and kind == "still" else 1e-5
        for k in range(part.start, part.stop):
            step = 1e-6 * np.eye(COUNT)[k]
            differences = (value(theta + step) - value(theta - step)) / 2e-6
            column = np.asarray(jacobian[:, :, k]).T
            np.testing.assert_allclose(
                column, differences, atol=tolerance * max(np.abs(column).max(), 1e-9), err_msg=name
            )


def test_between_the_samples_stands_the_trajectorys_own_motion(brief):
    """At any delay: value and slope of the quintic spline against the closed form, at rest of the filter's lag."""
    run = simulate(dataclasses.replace(brief, sources=()), "T1").run
    rows = in_band(run, BAND, reach=0.02)
    lag = (len(low_pass(run.rate, BAND, rows.factor)) - 1) / 2 / run.rate
    trajectory = brief.trajectories["T1"].trajectory
    omega, alpha, _ = evaluate(rows.motion, rows.step, rows.t + 0.0131)
    at = rows.t + 0.0131 + lag
    np.testing.assert_allclose(omega.T, jax.vmap(trajectory.omega)(at), atol=2e-7)
    np.testing.assert_allclose(alpha.T, jax.vmap(trajectory.alpha)(at), atol=4e-6)

"""Signs and axes of wrench and motion: every signed permutation is recognised, a small turn measured."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.judge.conventions import convention_fit, convention_sums, conventions
from identify.judge.conventions.convention_sums import ImuSignal, WrenchSignal
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import PAIRS
from identify.rigid_body.rotation import exponential
from tests.helpers.spoiled_runs import T1, sensors


@cache
def good():
    """T1 in ten seconds with the noise of the preset, the accelerometer's own too."""
    return sensors(T1, seed=7, noise=0.02)


def sums(run):
    start, wrench, imu = run.wrench.stamp[0], run.wrench, run.imu
    return convention_sums.convention_sums(
        WrenchSignal((wrench.stamp - start) * 1e-9, wrench.force, wrench.moment),
        ImuSignal((imu.stamp - start) * 1e-9, imu.angular_velocity, imu.linear_acceleration),
    )


def test_every_order_and_sign_of_the_axes_is_recognised():
    """All 48 of the load cell's, and the 24 left-handed ones of the IMU's.

    All axes of one sensor reversed differ from all of the other reversed by the terms quadratic in omega alone: in this
    noise the two may stay undecided, and then both are named.
    """
    whole = sums(good())
    for hypothesis in conventions.hypotheses():
        spoiled = hypothesis.applied(whole)
        explained = conventions.best_axes(spoiled, conventions.scales(spoiled, weight=True))
        held = [
            best.sensor == hypothesis.sensor and np.array_equal(best.matrix, hypothesis.matrix.T) for best in explained
        ]
        assert held[0] or (np.array_equal(hypothesis.matrix, -np.eye(3)) and held == [False, True])


@pytest.mark.parametrize("turn", [[0.0, 5.0, 0.0], [0.0, 0.0, 5.0], [3.0, -3.0, 3.0]])
def test_a_small_turn_between_the_sensors_is_measured(turn):
    """Chi-square on three degrees of freedom stays below 22 with a chance of 7e-5; the turn is that planted."""
    whole = sums(good())
    given = conventions.scales(whole, weight=True, terms=convention_fit.MOMENT_TERMS)
    before, chance = conventions.misalignment(whole, given)
    assert chance < 22
    turned = whole.turned(imu=exponential(np.radians(turn)))
    measured_turn, chi_square = conventions.misalignment(
        turned, conventions.scales(turned, weight=True, terms=convention_fit.MOMENT_TERMS)
    )
    assert chi_square > 22
    # the turn that undoes: chance's own turn after the planted one's inverse, to second order
    np.testing.assert_allclose(np.degrees(measured_turn - before), np.negative(turn), atol=0.4)


def test_the_equations_are_exact(generator):
    """A rigid body's wrench, from the textbook formulae, leaves nothing: 1e-9 of the sums."""
    n, mass, r, lever = 4000, 3.0, np.array([0.1, -0.2, 0.05]), np.array([0.03, 0.02, -0.06])
    draw = generator.normal(size=(n, 12)) * 2
    omega, alpha, specific = draw[:, :3], draw[:, 3:6], draw[:, 6:9] + [0, 0, 9.81]
    inertia = np.array([0.4, 0.02, -0.03, 0.5, 0.05, 0.6])
    tensor = unpack(inertia)
    at_cg = specific + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
    force = mass * at_cg
    moment = np.cross(r, force) + alpha @ tensor + np.cross(omega, omega @ tensor)
    products = np.stack([omega[:, i] * omega[:, j] for i, j in PAIRS], axis=1)
    rows = np.hstack([force, moment, specific, draw[:, 9:12], np.ones((n, 1)), omega, products, alpha])
    whole = convention_sums.ConventionSums(rows.T @ rows / n, float(n))
    of_force = convention_fit.solve(whole, convention_fit.FORCE_TERMS, convention_sums.FORCE, variance=1.0)
    np.testing.assert_allclose(of_force.values, [mass, *(mass * lever), 0, 0, 0], atol=1e-7)
    of_moment = convention_fit.solve(whole, convention_fit.MOMENT_TERMS, convention_sums.MOMENT, variance=1.0)
    np.testing.assert_allclose(of_moment.values, [*r, *inertia, 0, 0, 0], atol=1e-7)
    assert abs(of_force.misfit) + abs(of_moment.misfit) < 1e-4


def test_turned_features_are_those_of_turned_signals():
    run, matrix = good(), exponential(np.array([0.3, -1.0, 2.0]))
    np.testing.assert_allclose(
        sums(run).turned(imu=matrix, wrench=matrix.T).gram, sums(run.of_imu(matrix).of_wrench(matrix.T)).gram, atol=1e-6
    )


def test_carried_gravity_stays_gravity_through_any_turn_and_forgets_a_wrong_start():
    """True gravity in the body's frame, from the attitude as SciPy integrates it; the start is the mean of half a second."""
    step = 0.0025
    time = np.arange(0, 120, step)
    omega = 2.0 * np.stack([np.sin(time), 0.2 + np.cos(1.3 * time), np.sin(0.7 * time + 1)], axis=1)
    attitude = Rotation.identity()
    gravity = np.empty_like(omega)
    for i, turn in enumerate(Rotation.from_rotvec(step * omega)):
        attitude = attitude * turn
        gravity[i] = attitude.apply([0, 0, 9.81], inverse=True)
    carried = convention_sums.carried_gravity(step, omega, gravity)
    np.testing.assert_allclose(np.linalg.norm(carried, axis=1), 9.81, rtol=1e-9)
    miss = np.linalg.norm(carried - gravity, axis=1)
    assert miss[-1] == pytest.approx(miss[0] * np.exp(-time[-1] / convention_sums.RECALL), rel=0.1)
    assert miss[0] > 0.1

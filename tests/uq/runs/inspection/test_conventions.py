"""Axes and signs of a simulated recording: each order is recognised, a small turn measured."""

from functools import cache

import numpy as np
import pytest

from identify.judge.conventions import axis_hypotheses, convention_fit
from identify.judge.conventions.convention_fit import ImuSignal, WrenchSignal
from identify.rigid_body.rotation import exponential
from tests.helpers.spoiled_runs import T1, sensors


@cache
def good():
    """T1 in ten seconds with the noise of the preset, the accelerometer's own too."""
    return sensors(T1, seed=7, noise=0.02)


def sums(run):
    start, wrench, imu = run.wrench.stamp[0], run.wrench, run.imu
    return convention_fit.convention_sums(
        WrenchSignal((wrench.stamp - start) * 1e-9, wrench.force, wrench.moment),
        ImuSignal((imu.stamp - start) * 1e-9, imu.angular_velocity, imu.linear_acceleration),
    )


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_every_order_and_sign_of_the_axes_is_recognised(every):
    """All 48 of the load cell's, and the 24 left-handed ones of the IMU's; or one in three of them.

    All axes of one sensor reversed differ from all of the other reversed by the terms quadratic in omega alone: in this
    noise the two may stay undecided, and then both are named.
    """
    whole = sums(good())
    for hypothesis in [*axis_hypotheses.hypotheses()][::every]:
        spoiled = hypothesis.applied(whole)
        explained = axis_hypotheses.best_axes(spoiled, axis_hypotheses.scales(spoiled, weight=True))
        held = [
            best.sensor == hypothesis.sensor and np.array_equal(best.matrix, hypothesis.matrix.T) for best in explained
        ]
        assert held[0] or (np.array_equal(hypothesis.matrix, -np.eye(3)) and held == [False, True])


@pytest.mark.parametrize("turn", [[0.0, 5.0, 0.0], [0.0, 0.0, 5.0], [3.0, -3.0, 3.0]])
def test_a_small_turn_between_the_sensors_is_measured(turn):
    """Chi-square on three degrees of freedom stays below 22 with a chance of 7e-5; the turn is that planted."""
    whole = sums(good())
    given = axis_hypotheses.scales(whole, weight=True, terms=convention_fit.MOMENT_TERMS)
    before, chance, _ = axis_hypotheses.misalignment(whole, given)
    assert chance < 22
    turned = whole.turned(imu=exponential(np.radians(turn)))
    measured_turn, chi_square, _ = axis_hypotheses.misalignment(
        turned, axis_hypotheses.scales(turned, weight=True, terms=convention_fit.MOMENT_TERMS)
    )
    assert chi_square > 22
    # the turn that undoes: chance's own turn after the planted one's inverse, to second order
    np.testing.assert_allclose(np.degrees(measured_turn - before), np.negative(turn), atol=0.4)


def test_turned_features_are_those_of_turned_signals():
    run, matrix = good(), exponential(np.array([0.3, -1.0, 2.0]))
    np.testing.assert_allclose(
        sums(run).turned(imu=matrix, wrench=matrix.T).gram, sums(run.of_imu(matrix).of_wrench(matrix.T)).gram, atol=1e-6
    )

"""``mujoco.sysid`` gives back payload and thrown body where nothing errs, and its interval where a known noise does."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from identify.motion.serial_arm.joint_series import JointSeries
from identify.rigid_body.inertia import Body
from identify.signals.run import Run
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.mujoco_run import simulated

pytest.importorskip("mujoco")

from benchmarks.studies.mujoco_sysid import AVAILABLE, body_by_sysid, payload_by_sysid, thrown_by_sysid

ARM = Path(__file__).parents[3] / "uq" / "examples" / "arm.toml"
pytestmark = pytest.mark.skipif(not AVAILABLE, reason="mujoco[sysid] is not installed")


def test_payload_where_nothing_errs():
    """All joints swing for 1 s; the start is 20 % light, and offsets of the sensor are unknown."""
    experiment = Experiment.load(ARM)
    arm, body, sines = Arm.of(experiment), experiment.body, 0.3 * np.eye(6)
    still, ends = np.zeros((6, 6)), (np.zeros(6), np.full(6, 4.0))
    series = JointSeries(arm.home, np.linspace(0.6, 1.6, 6), still, sines, *ends, np.array(0.5))
    run = simulated(arm, body, experiment.gravity, series)
    wrench = run.wrench + [2.0, -1.0, 1.0, 0.1, 0.2, -0.1]
    nominal = Body(np.asarray(0.8 * body.mass), body.r_cg_from_q, 0.8 * body.inertia)
    values, covariance = payload_by_sysid(arm, nominal, experiment.gravity, run.t, run.joints, wrench)
    r_cg = body.r_cg_from_q
    steiner = body.mass * (r_cg @ r_cg * np.eye(3) - np.outer(r_cg, r_cg))[np.triu_indices(3)]
    np.testing.assert_allclose(values, [2.0, *(2.0 * r_cg), *(body.inertia + steiner)], rtol=1e-6)
    assert np.sqrt(np.diag(covariance)).max() < 1e-6


def test_body_on_a_platform_where_nothing_errs():
    """Newton's and Euler's equations about Q, in closed form; the start is 20 % light, and offsets are unknown."""
    mass, r_cg = 2.0, np.array([0.01, -0.02, 0.06])
    tensor = np.array([[9e-3, 1e-4, -2e-4], [1e-4, 8e-3, 3e-4], [-2e-4, 3e-4, 5e-3]])
    about_q = tensor + mass * (r_cg @ r_cg * np.eye(3) - np.outer(r_cg, r_cg))
    t = np.arange(200) / 100
    turns = 2 * np.pi * np.array([1.0, 1.7, 2.3])
    omega, alpha = 2 * np.sin(np.outer(t, turns)), 2 * turns * np.cos(np.outer(t, turns))
    felt = [0.0, 0.0, 9.8] + np.cos(np.outer(t, turns[::-1]))
    force = mass * (felt + np.cross(alpha, r_cg) + np.cross(omega, np.cross(omega, r_cg)))
    moment = alpha @ about_q + np.cross(omega, omega @ about_q) + np.cross(mass * r_cg, felt)
    wrench = np.hstack([force, moment]) + [2.0, -1.0, 1.0, 0.1, 0.2, -0.1]
    nominal = Body(np.asarray(0.8 * mass), r_cg, 0.8 * tensor[np.triu_indices(3)])
    values, _ = body_by_sysid(nominal, t, omega, alpha, felt, wrench)
    np.testing.assert_allclose(values, [mass, *(mass * r_cg), *about_q[np.triu_indices(3)]], rtol=0, atol=1e-6)


def test_thrown_body_by_an_integration_of_scipy():
    """Two flights of 0.4 s; a control held over 1 ms has (2π · 15 Hz · 1 ms)² / 12 = 7e-4 less of the fastest moment."""
    tensor = np.array([[1.7e-3, 2e-5, -1e-5], [2e-5, 0.4e-3, 3e-5], [-1e-5, 3e-5, 1.6e-3]])
    t = np.arange(401) / 1000
    runs = [_flight(t, tensor, start) for start in ([9.0, -1.0, 2.0], [-2.0, 7.0, 3.0])]
    values, _ = thrown_by_sysid(runs, 1.1 * tensor[np.triu_indices(3)])
    np.testing.assert_allclose(values, tensor[np.triu_indices(3)], rtol=0, atol=5e-4 * tensor[0, 0])


def _flight(t, tensor, start):
    def moment(t):
        return 0.03 * np.sin(2 * np.pi * np.multiply.outer(t, [5.0, 9.0, 15.0]) + [0.0, 1.0, 2.0])

    def acceleration(t, omega):
        return np.linalg.solve(tensor, moment(t) - np.cross(omega, tensor @ omega))

    omega = solve_ivp(acceleration, (t[0], t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-10).y.T
    return Run.from_arrays(t, np.zeros((len(t), 3)), moment(t), omega)

"""Signs and axes of wrench and motion: every signed permutation is recognised, a small turn measured."""

import numpy as np
from scipy.spatial.transform import Rotation

from identify.judge.conventions import convention_fit
from identify.judge.conventions.carried_attitude import RECALL, carried_gravity
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import PAIRS


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
    whole = convention_fit.ConventionSums(rows.T @ rows / n, float(n))
    of_force = convention_fit.solve(whole, convention_fit.FORCE_TERMS, convention_fit.FORCE, variance=1.0)
    np.testing.assert_allclose(of_force.values, [mass, *(mass * lever), 0, 0, 0], atol=1e-7)
    of_moment = convention_fit.solve(whole, convention_fit.MOMENT_TERMS, convention_fit.MOMENT, variance=1.0)
    np.testing.assert_allclose(of_moment.values, [*r, *inertia, 0, 0, 0], atol=1e-7)
    assert abs(of_force.misfit) + abs(of_moment.misfit) < 1e-4


def test_carried_gravity_stays_gravity_through_any_turn_and_forgets_a_wrong_reading():
    """True gravity in the body's frame, from the attitude as SciPy integrates it; wrong readings count for ``RECALL``."""
    step = 0.0025
    time = np.arange(0, 60, step)
    omega = 2.0 * np.stack([np.sin(time), 0.2 + np.cos(1.3 * time), np.sin(0.7 * time + 1)], axis=1)
    attitude = Rotation.identity()
    gravity = np.empty_like(omega)
    for i, turn in enumerate(Rotation.from_rotvec(step * omega)):
        attitude = attitude * turn
        gravity[i] = attitude.apply([0, 0, 9.81], inverse=True)
    reading = np.where(time[:, None] < 0.5, [9.81, 0, 0], gravity)
    carried = carried_gravity(step, omega, reading)
    np.testing.assert_allclose(np.linalg.norm(carried, axis=1), 9.81, rtol=1e-9)
    miss = np.linalg.norm(carried - gravity, axis=1) / 9.81
    assert miss[time > 0.5 + RECALL / 2].max() < 0.005  # half a step's turn is 0.003
    assert miss[0] > 0.02

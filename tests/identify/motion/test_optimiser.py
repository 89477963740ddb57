"""The minimiser under limits, periodic motions, and the bound's two halves, each against an independent oracle."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize as scipy_minimize

from identify.motion.information_bound import least
from identify.motion.largest_mean_square import largest_amplitude, largest_mean_square
from identify.motion.leg_limits import Limits
from identify.motion.optimiser import Lagrangian, minimise
from identify.motion.periodic_motion import accelerations


def test_a_linear_goal_ends_on_the_circle_of_its_limits():
    """Half planes around the unit circle: the least of ``c · x`` is ``-|c|``, within 1 - cos(π/500)."""
    angle = np.arange(500) * 2 * np.pi / 500
    normals, slope = np.stack([np.cos(angle), np.sin(angle)], axis=1), np.array([3.0, -4.0])
    lagrangian = Lagrangian(lambda x: (jnp.asarray(slope) @ x, jnp.asarray(normals) @ x - 1))
    reports = []
    optimum = minimise(lagrangian, np.zeros(2), rounds=15, progress=lambda *at: reports.append(at))
    np.testing.assert_allclose(optimum.goal, -5, rtol=2e-3)
    assert optimum.excess < 2e-3
    assert [at[0] for at in reports] == list(range(1, 16))
    assert optimum.evaluations > 15


def test_a_minimum_within_the_limits_is_left_alone():
    lagrangian = Lagrangian(lambda x: (((x - 0.3) ** 2).sum(), x - 1))
    optimum = minimise(lagrangian, np.full(3, 4.0), rounds=4)
    np.testing.assert_allclose(optimum.unknowns, 0.3, atol=1e-6)
    assert optimum.excess < 0


def test_units_of_the_unknowns_follow_the_limits():
    free = Limits.none()
    np.testing.assert_array_equal(accelerations(free), np.ones(6))
    np.testing.assert_array_equal(accelerations(free._replace(acceleration=np.full(6, 2.5))), np.full(6, 2.5))


def test_the_best_excursion_is_reached():
    """Rise, hold and fall at their fastest, repeated: its own mean square, integrated numerically."""
    a, v, band = 1.22, 0.128, 5.0
    most = largest_mean_square(a, v, band)
    fast = 2 * np.pi * band
    best = 0.0
    for turn in np.linspace(0.2, np.pi / 2, 500):
        hold = (2 * v / a - 2 / fast * (1 - np.cos(turn))) / np.sin(turn)
        rise = a * np.sin(np.linspace(0, turn, 2000))
        square = 2 * turn / fast * (rise**2).mean() + hold * rise[-1] ** 2
        best = max(best, square / (2 * turn / fast + hold))
    np.testing.assert_allclose(most, best, rtol=1e-3)


def test_no_signal_of_the_band_does_better(generator):
    """Random sums of sines, made as large as value and integral allow."""
    v, most = 0.128, largest_mean_square(1.22, 0.128, 5.0)
    t = np.linspace(0, 4, 4001)
    frequencies = np.arange(1, 21) / 4
    for _ in range(300):
        phase, size = generator.uniform(0, 2 * np.pi, 20), generator.exponential(size=20) ** 3
        angle = 2 * np.pi * frequencies * t[:, None] + phase
        value, integral = np.sin(angle) @ size, -np.cos(angle) @ (size / (2 * np.pi * frequencies))
        scale = min(1.22 / np.abs(value).max(), v / np.abs(integral).max())
        assert (scale * value).var() < most
    assert most < 0.8 * 1.22**2


def test_limits_of_the_mean_square():
    """Without a bound of the integral a square wave; with a tight one a sine of the highest frequency."""
    assert largest_mean_square(2.0, np.inf, 5.0) == 4.0
    tight = 1e-3
    np.testing.assert_allclose(largest_mean_square(2.0, tight, 5.0), (10 * np.pi * tight) ** 2 / 2, rtol=1e-3)
    assert largest_amplitude(2.0, tight, np.inf, 5.0) == 10 * np.pi * tight


def uncertainty(moment):
    return jnp.sqrt(jnp.diagonal(jnp.linalg.inv(moment))).mean()


def test_the_bound_is_tight_and_below_everything(generator):
    """Against the primal problem, solved by another route: factors of L with rows of the allowed length."""
    to_alpha = generator.normal(size=(3, 6))
    most = generator.uniform(0.5, 2.0, 6)
    bound = least(uncertainty, most, to_alpha)

    def primal(x):
        rows = x.reshape(6, 6)
        factor = to_alpha @ (jnp.sqrt(most)[:, None] * rows / jnp.linalg.norm(rows, axis=1, keepdims=True))
        return uncertainty(factor @ factor.T)

    slope = jax.jit(jax.value_and_grad(primal))
    values = [
        scipy_minimize(lambda x: tuple(map(np.asarray, slope(x))), generator.normal(size=36), jac=True).fun
        for _ in range(1)
    ]
    assert bound <= min(values)
    np.testing.assert_allclose(bound, min(values), rtol=5e-3)

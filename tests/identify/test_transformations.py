"""The pure kernels of identify under jit, vmap and grad: what ``identify``'s docstring promises of them.

Each kernel is reduced to one number, the sum of its results weighed by fixed random numbers, of all its array arguments
together. The derivative along a random direction must be the central difference: its error is ``h²`` times a third
derivative, here 1e-8 relative for ``h = 1e-4`` (checked to 1e-5), and rounding adds ``1e-16 / h``.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.least_squares import gram
from identify.motion.attitude import running_product
from identify.motion.leg_limits import PlatformMotion, effort
from identify.motion.multisine import Multisine
from identify.motion.stewart_platform import Pose, Twist, lengths
from identify.motion.trajectory import Harmonic, Sphere, sample, window
from identify.rigid_body import dynamics, fixture, inertia, principal_axes, pseudo_inertia, regressor, rotation, solids
from identify.rigid_body.inertia import Body
from identify.signals import differentiate, filters
from identify.signals.estimator_spec import EstimatorSpec
from tests.helpers.gram_lab import accumulate
from tests.helpers.platforms import small

TENSOR = np.array([0.38, 0.01, -0.02, 0.35, 0.015, 0.3])
VECTOR, OTHER, THIRD = np.array([0.3, -0.7, 0.5]), np.array([1.1, 0.4, -0.6]), np.array([0.2, 0.9, 9.7])
BODY = (np.array(21.0), np.array([0.01, -0.02, 0.08]), TENSOR)
SIGNAL = np.array([[1.0, 2.0, 4.0, 3.0, 5.0, 1.0], [0.0, 1.0, 1.0, 2.0, 3.0, 5.0], [2.0, 0.5, 1.0, 4.0, 3.0, 1.0]])
MOTION = SIGNAL * np.array([[1.0], [-1.0], [0.5]]), SIGNAL[:, ::-1]
PLATFORM = small()


def parameters(offset):
    """Ten parameters of a body."""
    return np.concatenate([[20.0 + offset], [0.01, 0.02, 0.1], TENSOR])


def swung(trajectory):
    """Specific force and attitude of a trajectory whose amplitude is scaled."""

    def of(scale, gravity):
        scaled = jax.tree.map(lambda leaf: scale * leaf, trajectory)
        t = jnp.linspace(0.3, 1.7, 8) * scale  # within the run, whose time is scaled too
        return sample(scaled, t, r_cg_from_still=VECTOR, gravity=gravity)[1:]

    return of


def rates(trajectory):
    """Angular velocity and acceleration of a trajectory whose amplitude is scaled."""

    def of(scale):
        scaled = jax.tree.map(lambda leaf: scale * leaf, trajectory)
        t = jnp.linspace(0.3, 1.7, 8) * scale
        return jax.vmap(scaled.omega)(t), jax.vmap(scaled.alpha)(t)

    return of


def carried(turn, shift, speed, omega):
    """Forces of the legs at one instant."""
    pose = Pose(jnp.asarray(PLATFORM.home) + 0.01 * shift, rotation.exponential(0.1 * turn))
    motion = PlatformMotion(
        jnp.zeros(1), *jax.tree.map(lambda leaf: leaf[None], (pose, Twist(speed, omega, speed, omega)))
    )
    return effort(PLATFORM, Body(*BODY), jnp.array([0.0, 0.0, 0.1]), motion, jnp.array(9.81)).force


MULTISINE = Multisine(np.array([0.5, 1.5]), np.full((6, 2), 0.02), np.full((6, 2), 0.01), np.array(2.0), np.array(0.4))
KERNELS = {
    "pack": (inertia.pack, np.outer(VECTOR, VECTOR)),
    "unpack": (inertia.unpack, TENSOR),
    "parallel_axis": (inertia.parallel_axis, TENSOR, np.array(3.0), VECTOR),
    "rotate": (inertia.rotate, TENSOR, np.outer(VECTOR, OTHER)),
    "principal moments": (lambda tensor: principal_axes.principal(tensor)[0], TENSOR),
    "exponential": (rotation.exponential, VECTOR),
    "exponential near zero": (rotation.exponential, 1e-5 * VECTOR),
    "rate_of_turn": (rotation.rate_of_turn, VECTOR, OTHER),
    "wrench": (lambda mass, r, tensor, *motion: dynamics.wrench(Body(mass, r, tensor), *motion), *BODY, VECTOR, OTHER, THIRD),
    "moment_about_cg": (dynamics.moment_about_cg, TENSOR, *MOTION),
    "acceleration_at": (dynamics.acceleration_at, VECTOR, OTHER, THIRD),
    "omega_r": (regressor.omega_r, VECTOR, OTHER),
    "pi": (regressor.pi, VECTOR),
    "wrench_regressor": (regressor.wrench_regressor, VECTOR, OTHER, THIRD),
    "log_cholesky": (pseudo_inertia.log_cholesky, TENSOR),
    "pseudo_inertia": (pseudo_inertia.pseudo_inertia, parameters(-19.5)),
    "cylinder": (lambda *sizes: solids.cylinder(*sizes), np.array(0.3), np.array(0.2), np.array(0.1)),
    "sphere": (lambda *sizes: solids.sphere(*sizes), np.array(0.3), np.array(0.1)),
    "left_over": (fixture.left_over, np.concatenate([parameters(0.0), 0.1 * parameters(1.0)])),
    "window": (window, np.array(0.4), np.array(3.0), np.array(1.0)),
    "running_product": (running_product, np.stack([np.outer(VECTOR, OTHER), np.eye(3), np.outer(OTHER, THIRD)])),
    "sphere trajectory": (swung(Sphere(1.0, 4.0, 2.0, 0.4, 1.0, 1)), np.array(1.0), np.array(9.8)),
    "harmonic trajectory": (rates(Harmonic(1.0, 4.0, 2.0, 0.2)), np.array(1.0)),
    "multisine": (rates(MULTISINE), np.array(1.0)),
    "leg lengths": (lambda p, turn: lengths(PLATFORM, Pose(p, rotation.exponential(turn))), np.array([0.0, 0.05, 0.6]), 0.2 * VECTOR),
    "leg forces": (carried, VECTOR, OTHER, 0.1 * THIRD, OTHER),
    "derivative": (differentiate.derivative, SIGNAL, np.array([50.0, 10.0])),
    "filter": (filters.apply, SIGNAL, np.array([0.25, 0.5, 0.25])),
    "gram sums": (accumulate, *MOTION, SIGNAL, SIGNAL**2),
    "least squares from sums": (
        lambda *signals: gram.solve(accumulate(*signals), jnp.array(VECTOR)).inertia, *MOTION, SIGNAL, SIGNAL**2,
    ),
    "ordinary_least_squares": (
        lambda *arrays: gram.ordinary_least_squares(
            *arrays[:3], rate=10.0, r_cg=arrays[3], estimator=EstimatorSpec("short", "savitzky-golay", window=5)
        ),
        *(np.random.default_rng(seed).normal(size=(12, 3)) for seed in range(3)), VECTOR,
    ),
}  # fmt: skip


def as_number(kernel, seed=0):
    """The kernel's results, weighed and summed."""

    def total(*arrays):
        leaves = jax.tree.leaves(kernel(*arrays))
        weights = np.random.default_rng(seed)
        return sum(jnp.sum(jnp.asarray(weights.normal(size=jnp.shape(leaf))) * leaf) for leaf in leaves)

    return total


DEAR = {"leg forces", "sphere trajectory", "multisine", "least squares from sums", "ordinary_least_squares"}
"""They compile for seconds. Derivatives of the forces: ``motion/test_stewart_platform.py``; another trajectory is here;
of least squares: ``how-to/derivatives.md``, which ``test_pages.py`` runs."""
POLYNOMIALS = {
    "pack", "unpack", "parallel_axis", "rotate", "wrench", "moment_about_cg", "acceleration_at", "pi", "wrench_regressor",
    "cylinder", "sphere", "left_over", "gram sums",
}  # fmt: skip
"""Sums and products, as ``omega_r``: no branch, root or rule of its own that a derivative or a batch could miss."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in DEAR | POLYNOMIALS else name for name in KERNELS]
)
def test_a_kernel_is_jitted_batched_and_differentiated(name, generator):
    kernel, *arrays = KERNELS[name]
    arrays = [np.asarray(array, float) for array in arrays]
    slopes = jax.jit(jax.value_and_grad(as_number(kernel), tuple(range(len(arrays)))))

    batch = [np.stack([array, 1.01 * array, 0.98 * array]) for array in arrays]
    each = [slopes(*(array[k] for array in batch))[0] for k in range(3)]
    np.testing.assert_allclose(jax.jit(jax.vmap(as_number(kernel)))(*batch), each, rtol=1e-9, atol=1e-9)

    along = [generator.normal(size=array.shape) * (1e-2 + np.abs(array)) for array in arrays]
    value, gradient = slopes(*arrays)
    slope = sum(np.vdot(g, a) for g, a in zip(gradient, along, strict=True))
    ends = [slopes(*(a + h * d for a, d in zip(arrays, along, strict=True)))[0] for h in (1e-4, -1e-4)]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-4, rtol=1e-5, atol=1e-6 * (1 + abs(float(value))))

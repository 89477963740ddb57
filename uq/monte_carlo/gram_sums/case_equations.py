"""Normal equations of one case and estimator from its Gram sums, many trials at a time, the trials on the last axis.

Everything that differs from trial to trial is a map of the sums (:mod:`uq.monte_carlo.gram_sums.error_maps` says
which): errors of the gyro act on both sides of the features' Gram matrix, those of the load cell on the wrench's side.
Trials stand last so that whole vectors of them go through a processor's vector units. What is the same in all trials
has length 1 there.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, PAIRS, Array, ArrayT, library_of
from uq.monte_carlo.gram_sums.noise_algebra import expectation_terms
from uq.monte_carlo.gram_sums.run_sums import FeatureSums

OF_OMEGA_R = slice(4, 13)
"""Features in which Omega_R is linear: the products of omega, and alpha."""
AXES = PAIRS
"""Pairs of axes of the moment."""
FACTORS = np.array([
    (0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3), (0, 4), (1, 4), (2, 4), (3, 4),
    (4, 4),
])  # fmt: skip
"""The true elements but alpha as products of two of 1, omega, t."""
LEFT, RIGHT = np.eye(5)[FACTORS[:, 0]].T, np.eye(5)[FACTORS[:, 1]].T
TWO_WAYS = (FACTORS[:, 0] != FACTORS[:, 1]).astype(float)
"""Elements that stand twice in a product of two linear functions of 1, omega, t."""


LOWER6, LOWER9 = (np.array([(i, j) for i in range(size) for j in range(i + 1)]) for size in (6, 9))
"""Places of the lower triangle."""
PLACE6 = np.zeros((6, 6), np.int32)
"""Place of each entry of a symmetric matrix in its lower triangle."""
PLACE6[tuple(LOWER6.T)] = PLACE6.T[tuple(LOWER6.T)] = range(21)
CROSS = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(2, 1, 0)
"""``(CROSS @ r) @ F`` is ``r × F``."""


def _weights() -> np.ndarray:
    """Return the matrix from sums of pairs of features to ``Σ Ω_aᵀ Ω_b + Ω_bᵀ Ω_a``, of one axis ``Σ Ω_aᵀ Ω_a``."""
    rows = OMEGA_R_OF_FEATURES[OF_OMEGA_R]
    pairs = []
    for a, b in AXES:
        # Ω_a = Σ_k φ_k P_k,a: each row of the regressor is linear in nine features, so that Σ Ω_aᵀ Ω_b is linear in
        # the sums of the 45 products of two of them
        product = np.einsum("ki,mj->ijkm", rows[:, a], rows[:, b])
        both = product if a == b else product + product.swapaxes(0, 1)
        pairs.append((both + both.swapaxes(2, 3)) / 2)  # of symmetric sums
    lower = np.stack(pairs)[:, LOWER6[:, 0], LOWER6[:, 1]]
    # half-vectorisation: of a symmetric matrix the lower triangle is summed, whose entries off the diagonal stand
    # twice
    twice = np.where(LOWER9[:, 0] == LOWER9[:, 1], 1, 2)
    return (twice * lower[:, :, LOWER9[:, 0], LOWER9[:, 1]]).reshape(len(AXES) * 21, 45)


WEIGHTS = _weights()
RIGHT_SIDE = OMEGA_R_OF_FEATURES[OF_OMEGA_R].transpose(2, 0, 1).reshape(6, 27)


class NoiseExpectation(NamedTuple):
    """Additions of the gyro's noise to expected sums, as multiples of the features' own sums."""

    gram: Float[Array, "45 13"]
    """Additions to the products of the features of Omega_R."""
    feature: Float[Array, "9"]
    """Additions to the features of Omega_R."""


NO_NOISE = NoiseExpectation(np.zeros((45, 13)), np.zeros(9))


def noise_expectation(
    omega: Float[Array, "3 3"], alpha: Float[Array, "3 3"], *, fourth_order: bool = True
) -> NoiseExpectation:
    """Return what normal noise of the gyro adds to expected sums: exact for noise of any size, unless told otherwise.

    Args:
        omega: covariance of the noise of omega at one sample [rad²/s²].
        alpha: covariance of the noise of the differentiator's alpha [rad²/s⁴].
        fourth_order: whether products of four noises count; else the second order alone, ``½ tr(H Σ)``.

    A product of two products of omega has noise to the fourth power, whose expectation is a sum over pairings
    (Isserlis). The second order holds each pair of noises beside the two signals that are left. With these replaced by
    their own noise, each pairing stands there twice: hence the half.
    """
    xp = library_of(omega, alpha)
    terms = xp.einsum("kmcijf,cij->kmf", expectation_terms(), xp.stack([omega, alpha]))
    features, pairs = terms[0, :, 0], terms[4 + LOWER9[:, 0], 4 + LOWER9[:, 1]]  # a feature is its product with 1
    if fourth_order:
        pairs = pairs + (pairs @ features)[:, None] / 2 * np.eye(1, 13)
    return NoiseExpectation(pairs, features[4:])


def sums_by_axes(gram: Float[ArrayT, "9 9 *#trials"]) -> Float[ArrayT, "6 21 *#trials"]:
    """Return ``Σ Ω_aᵀ Ω_b`` with its transpose, pair by pair of axes, from the Gram matrix of Omega_R's features."""
    xp = library_of(gram)
    lower = xp.concat([gram[i, : i + 1] for i in range(9)])
    return xp.tensordot(WEIGHTS, lower, 1).reshape(len(AXES), 21, *gram.shape[2:])


class Equations(NamedTuple):
    """Normal equations before the load cell's noise."""

    by_axes: Float[jax.Array, "6 21 *#trials"]
    """``Σ Ω_aᵀ Ω_b`` with its transpose for each pair of axes: the normal matrix is the sum of the first three."""
    right: Float[jax.Array, "6 *#trials"]


def times(first: Float[ArrayT, "i k *#trials"], second: Float[ArrayT, "k j *#trials"]) -> Float[ArrayT, "i j *#trials"]:
    """Return the product of two matrices trial by trial, as a sum of outer products: each is one long loop."""
    # as one sum over an axis it compiles faster, but many-errors.toml takes 2.7 times as long (benchmarks.answers)
    total = first[:, 0, None] * second[None, 0]
    for k in range(1, first.shape[1]):
        total = total + first[:, k, None] * second[None, k]
    return total


def feature_map(
    gyro: Float[ArrayT, "3 3 *#trials"], bias: Float[ArrayT, "3 *#trials"], drift: Float[ArrayT, "3 *#trials"] | None
) -> Float[ArrayT, "13 elements *#trials"]:
    """Return the matrix that gives the features of ``G omega + b + d t`` from the elements of the true motion.

    These are 1, omega, its products, with a drift t, t omega, t², and alpha.
    """
    trials: tuple[int, ...] = np.broadcast_shapes(gyro.shape[2:], bias.shape[1:])
    count = 10 if drift is None else 15
    parts = [bias[:, None], gyro, *([] if drift is None else [drift[:, None]])]
    xp = library_of(*parts)
    sensed = xp.concat([xp.broadcast_to(x, x.shape[:2] + trials) for x in parts], axis=1)
    # what is sensed, S (1, ω, t), is linear, and its products are quadratic: expanded in the true elements, each of
    # which is a product of two of 1, ω, t as well
    first, second = (xp.einsum("ab...,bn->an...", sensed, x[: sensed.shape[1], :count]) for x in (LEFT, RIGHT))
    twice = TWO_WAYS[:count].reshape(1, count, *[1] * len(trials))
    i, j = np.array(PAIRS).T
    products = first[i] * second[j] + twice * second[i] * first[j]

    def placed(rows: Array, before: int) -> Array:
        after = count + 3 - before - rows.shape[1]
        return xp.pad(rows, [(0, 0), (before, after), *[(0, 0)] * len(trials)])

    constant = placed(xp.ones((1, 1, *trials)), 0)
    linear = placed(sensed[:, :4], 0)
    alpha = placed(xp.broadcast_to(gyro, (3, 3, *trials)), count)
    if drift is not None:
        linear = linear + placed(sensed[:, 4:], 10)
        alpha = alpha + placed(sensed[:, 4:], 0)
    return xp.concat([constant, linear, placed(products, 0), alpha])


def equations_of(
    sums: FeatureSums,
    features: Float[Array, "13 elements *#trials"],
    noise: NoiseExpectation,
    cell: Float[Array, "6 functions *#trials"] | None,
    cell_bias: Float[Array, "6 *#trials"],
    r_cg: Float[Array, "3 *#trials"],
) -> Equations:
    """Return the normal equations of a case with its constant errors.

    Args:
        sums: over the elements.
        features: the gyro's map, of :func:`feature_map`.
        noise: what the gyro's noise adds on the average: it is not mapped, since it arises behind the sensor's axes.
        cell: the load cell's map, of :meth:`uq.monte_carlo.gram_sums.error_maps.WrenchBasis.map`; None: nothing.
        cell_bias: its offset [N, N·m].
        r_cg: believed centre of gravity from Q, in B [m].
    """
    barrier = jax.lax.optimization_barrier  # between products, each of whose factors XLA would else compute many times
    sums, features = barrier((sums, features))
    rows_of_omega_r = features[OF_OMEGA_R]
    # congruence: where errors turn the features φ into T φ, their Gram matrix S becomes T S Tᵀ, and their products W
    # with the wrench T W; so a trial never visits a sample
    mapped = barrier(times(rows_of_omega_r, sums.gram))
    gram = times(mapped, rows_of_omega_r.swapaxes(0, 1))
    totals = times(features, sums.gram[:, :1])[:, 0]
    trials = gram.shape[2:]
    gram = jnp.concatenate([gram[i, : i + 1] for i in range(9)]) + jnp.tensordot(noise.gram, totals, 1)
    wrench = (
        times(rows_of_omega_r, sums.wrench)
        + jnp.expand_dims(noise.feature, (1, *range(2, 2 + len(trials)))) * sums.wrench[:1]
    )
    gram, totals, wrench = barrier((gram, totals, wrench))
    if cell is not None:
        wrench = times(wrench, cell.swapaxes(0, 1))
    # an offset of the load cell multiplies the sums of the features themselves: their products with the feature 1
    expected = totals[OF_OMEGA_R] + jnp.expand_dims(noise.feature, tuple(range(1, 1 + len(trials)))) * totals[:1]
    wrench = wrench + expected[:, None] * cell_bias[None]
    force, moment = wrench[:, :3], wrench[:, 3:]
    # y = M - r × F is linear in the wrench, so that the believed centre of gravity may come after the summation
    residual = moment - jnp.cross(r_cg[None], force, axis=1)
    # Ωᵀ y = Σ_k P_kᵀ Σ φ_k y, with the P_k of Ω = Σ_k φ_k P_k
    right = jnp.tensordot(RIGHT_SIDE, residual.reshape(27, *residual.shape[2:]), 1)
    by_axes = jnp.tensordot(WEIGHTS, gram, 1).reshape(len(AXES), 21, *trials)
    return Equations(*barrier((by_axes, right)))


def residual_covariance(
    cell: Float[ArrayT, "6 6 *#trials"], r_cg: Float[ArrayT, "3 *#trials"]
) -> Float[ArrayT, "6 *trials"]:
    """Return the covariance of ``M - r × F`` for that of force and moment, pair by pair of :data:`AXES`."""
    # B S Bᵀ with B = [-[r]×, 1]
    xp = library_of(cell, r_cg)
    of_force = -xp.tensordot(CROSS, r_cg, 1)  # -r × F of a unit force, an axis a column
    of_moment = xp.broadcast_to(xp.expand_dims(xp.eye(3), tuple(range(2, of_force.ndim))), of_force.shape)
    of_both = xp.concat([of_force, of_moment], axis=1)
    a, b = np.array(AXES, np.int32).T
    return times(times(of_both, cell), of_both.swapaxes(0, 1))[a, b]


def weighted_sums(
    by_axes: Float[ArrayT, "6 21 *#trials"], cell: Float[ArrayT, "6 6 *#trials"], r_cg: Float[ArrayT, "3 *#trials"]
) -> Float[ArrayT, "21 *trials"]:
    """Return ``Σ Ωᵀ S Ω`` for the covariance S of ``M - r × F`` that a covariance of force and moment makes."""
    # S is the same at every sample, and leaves the sum: Σ Ωᵀ S Ω = Σ_ab S_ab Σ Ω_aᵀ Ω_b, six sums for any S
    covariance = residual_covariance(cell, r_cg)
    return sum((by_axes[a] * covariance[a, None] for a in range(1, len(AXES))), by_axes[0] * covariance[0, None])


def noise_of_right_side(
    covariance: Float[Array, "21 *#trials"], normal: Float[Array, "6 *#trials"]
) -> Float[Array, "6 *#trials"]:
    """Return the load cell's noise in the right side, from six standard normal numbers.

    R z with R Rᵀ the covariance (Cholesky), column by column: less the column's outer product, the covariance of the
    rows below is left. A column whose pivot is not positive is zero, so that a singular covariance has its root.
    """
    rest, drawn = symmetric(covariance), jnp.zeros((), covariance.dtype)
    for k, number in enumerate(normal):
        positive = rest[0, 0] > 0
        # a safe denominator: the branch that is not taken must have no NaN in its derivative
        scale = jnp.where(positive, jax.lax.rsqrt(jnp.where(positive, rest[0, 0], 1.0)), 0.0)
        column = rest[:, 0] * scale[None]
        drawn = drawn + jnp.pad(column * number[None], [(k, 0), *[(0, 0)] * number.ndim])
        rest = rest[1:, 1:] - column[1:, None] * column[None, 1:]
    return drawn


def symmetric(lower: Float[ArrayT, "21 *#trials"]) -> Float[ArrayT, "6 6 *#trials"]:
    """Return the matrix with this lower triangle, row by row."""
    return lower[PLACE6]

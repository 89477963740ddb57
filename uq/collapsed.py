"""One trial without samples: the Gram sums themselves are drawn, so nothing grows with the length of the run.

A trial depends on the gyro's white noise through some two hundred sums over samples, whose mean and covariance are
known exactly (:mod:`uq.gram_moments`). Their part linear in the noise is normal; their quadratic part is a sum over all
samples and taken as normal too, which is the only approximation. Given these sums, the load cell's white normal noise
acts on the right side of the normal equations as one normal vector with the covariance ``Σ Ωᵀ S Ω``.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.gram import Sums, normal_equations, solve_normal, with_offsets
from identify.regressor import OMEGA_R_OF_FEATURES, cross_matrix
from uq.distributions import Normal
from uq.document import ExperimentError
from uq.errors import Errors, errors_of_cases
from uq.gram_moments import GramMoments, covariance, gram_moments, mean, own_products, unpack
from uq.measurement import cell_map
from uq.sources import Mixing, Source, block_key, draw_constants, stream_number
from uq.trial import Case, Setup, TrialEstimates

REFUSED, INSTEAD = "the sums over samples cannot be drawn (collapsed)", "draw samples"


class CollapsedSetup(eqx.Module):
    """Everything that a collapsed trial needs besides its key: nothing in it grows with the number of samples."""

    r_cg: Float[Array, "3"]
    """True centre of gravity from Q, in B [m]."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    cases: tuple[Case, ...] = eqx.field(static=True)
    mean: Float[Array, "variants products"]
    """Expected sums; the first variant is without noise of the gyro."""
    root: Float[Array, "variants products products"]
    """A square root of their covariance."""
    variant: Int[np.ndarray, " cases"]
    """Which variant acts in each case."""
    cell: Float[Array, "cases 6 6"]
    """Covariance of the load cell's white noise of one sample in each case; force before moment."""
    estimators: int = eqx.field(static=True)


def collapse(setup: Setup) -> CollapsedSetup:
    """Return what collapsed trials need of a prepared run in float64.

    Raises:
        ExperimentError: a source whose effect the sums' moments do not tell.
    """
    white = [source for source in setup.sources if source.kind == "precision"]
    other = [source.name for source in white if not isinstance(source.shape, Normal)]
    if other or setup.whole or setup.columns.time or setup.columns.motion:
        what = f"the noise of {', '.join(other)} is not normal" if other else "a source changes more than offsets"
        raise ExperimentError(f"{REFUSED}, since {what}: {INSTEAD}")
    gyro = [source for source in white if source.target == "omega"]
    if any(set(mix.names) & {source.name for source in gyro} for mix in setup.mixing):
        raise ExperimentError(f"{REFUSED}, since the gyro's noise is correlated: {INSTEAD}")
    acting = [tuple(source.name for source in gyro if source.name in case.sources) for case in setup.cases]
    variants = list(dict.fromkeys([(), *acting]))
    variances = [sum((jnp.asarray(s.sigma) ** 2 for s in gyro if s.name in names), jnp.zeros(3)) for names in variants]
    means, roots = _means_and_roots(gram_moments(setup), jnp.stack(variances))
    return CollapsedSetup(
        setup.body.r_cg_from_q, setup.sources, setup.mixing, setup.cases, means, roots,
        np.array([variants.index(names) for names in acting]),
        jnp.stack([_cell_covariance(white, setup.mixing, case) for case in setup.cases]), len(setup.estimators),
    )  # fmt: skip


@eqx.filter_jit
def _means_and_roots(moments: GramMoments, variances: Array) -> tuple[Array, Array]:
    def of_variant(variance):
        matrix = covariance(moments, variance)
        scale = jnp.sqrt(jnp.diag(matrix))
        inverse = jnp.where(scale > 0, 1 / jnp.where(scale > 0, scale, 1), 0)
        values, vectors = jnp.linalg.eigh(matrix * jnp.outer(inverse, inverse))
        return mean(moments, variance), scale[:, None] * vectors * jnp.sqrt(jnp.maximum(values, 0))[None]

    return jax.lax.map(of_variant, variances)


def _cell_covariance(white: Sequence[Source], mixing: Sequence[Mixing], case: Case) -> Float[Array, "6 6"]:
    """The covariance of what the case's sources add to one sample of force and moment."""
    active = [source for source in white if source.target in ("F", "M") and source.name in case.sources]
    total = jnp.zeros((6, 6))
    spreads = {s.name: jnp.eye(6)[:, 0:3] if s.target == "F" else jnp.eye(6)[:, 3:6] for s in active}
    spreads = {s.name: spreads[s.name] * jnp.asarray(s.sigma)[None] for s in active}
    for source in active:
        total += spreads[source.name] @ spreads[source.name].T
    for mix in mixing:
        ends = np.cumsum(mix.axes)
        parts = [(name, slice(end - size, end)) for name, size, end in zip(mix.names, mix.axes, ends, strict=True)]
        here = [(spreads[name], part) for name, part in parts if name in spreads]
        for one, rows in here:
            for another, columns in here:
                correlation = jnp.asarray(mix.correlation)[rows, columns]
                own = jnp.eye(3) if rows == columns else jnp.zeros((3, 3))
                total += one @ (correlation - own) @ another.T
    return total


def collapsed_trial(setup: CollapsedSetup, key: Key[Array, ""], index: Int[Array, ""]) -> TrialEstimates:
    """Run one trial on drawn sums; see :func:`uq.trial.trial`."""
    draws = draw_constants(setup.sources, setup.mixing, key, index, float)
    errors = errors_of_cases(setup.sources, draws, [case.sources for case in setup.cases])
    gyro = [source for source in setup.sources if source.kind == "precision" and source.target == "omega"]
    sums = setup.mean
    if gyro:
        z = jax.random.normal(block_key(stream_number(gyro[0].name), key, index, 0), setup.mean.shape[1:])
        sums = sums + setup.root @ z
    cell = [source for source in setup.sources if source.kind == "precision" and source.target in ("F", "M")]
    noise = jnp.zeros((setup.estimators, 6))
    if cell:
        noise = jax.random.normal(block_key(stream_number(cell[0].name), key, index, 0), noise.shape)
    found = [_estimates(setup, sums[setup.variant], k, noise[k], errors) for k in range(setup.estimators)]
    return TrialEstimates(jnp.stack([e.inertia for e in found]), jnp.stack([e.ok for e in found]))


def _estimates(setup: CollapsedSetup, sums, number: int, noise, errors: Errors):
    """One estimator's estimates of all cases."""
    own = sums[:, own_products(setup.estimators, number)]

    def of_case(sums, errors, cell):
        plain = unpack(sums, len(OMEGA_R_OF_FEATURES))
        both = jnp.concatenate([plain.force, plain.moment], axis=1) @ cell_map(errors).T
        measured = Sums(plain.gram, both[:, :3], both[:, 3:])
        shifted = with_offsets(measured, errors.gyro_bias, errors.cell_bias[:3], errors.cell_bias[3:])
        r_cg = setup.r_cg + errors.r_cg
        matrix, right = normal_equations(shifted, r_cg)
        return solve_normal(matrix, right + triangular_root(_right_covariance(shifted.gram, cell, r_cg)) @ noise)

    return jax.vmap(of_case)(own, errors, setup.cell)


_AXES = np.triu_indices(3)
_PAIRS = np.einsum("kai,lbj->abijkl", OMEGA_R_OF_FEATURES, OMEGA_R_OF_FEATURES)
_PAIRS = (_PAIRS + _PAIRS.swapaxes(0, 1))[_AXES] / (1 + np.eye(3)[_AXES])[:, None, None, None, None]
"""Shape (6, 6, 6, 13, 13): from a Gram matrix to ``Σ Ω_aᵀ Ω_b + Ω_bᵀ Ω_a`` of two axes, or ``Σ Ω_aᵀ Ω_a`` of one."""


def _right_covariance(gram, cell, r_cg) -> Float[Array, "6 6"]:
    """Covariance of ``Ωᵀ(M - r × F)`` for noise of this covariance at each sample."""
    of_residual = jnp.concatenate([-cross_matrix(r_cg), jnp.eye(3)], axis=1)
    per_sample = of_residual @ cell @ of_residual.T
    of_axes = jnp.einsum("pijkl,kl->pij", _PAIRS, gram)
    return jnp.tensordot(per_sample[_AXES], of_axes, axes=1)


def triangular_root(matrix: Float[Array, "6 6"]) -> Float[Array, "6 6"]:
    """Return the triangular root of a covariance in plain arithmetic; zero for a zero matrix."""
    index, columns = np.arange(len(matrix)), []
    for k in range(len(matrix)):
        pivot = matrix[k, k]
        scale = jnp.where(pivot > 0, 1 / jnp.sqrt(jnp.where(pivot > 0, pivot, 1)), 0)
        column = jnp.where(index >= k, matrix[:, k] * scale, 0)
        matrix = matrix - jnp.outer(column, column)
        columns.append(column)
    return jnp.stack(columns, axis=1)

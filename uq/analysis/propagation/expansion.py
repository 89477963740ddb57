"""The law of propagation about expected sums: one run, one estimator, arrays in and out.

What is expanded is what every trial computes: constant errors are maps of the sums (:func:`error_maps`), mapped sums
make normal equations, as expected under the gyro's noise
(:func:`uq.monte_carlo.gram_sums.packed_equations.packed_equations`), and these are solved. Only the maps are
differentiated by JAX, for the errors alone and once for all runs. The rest are products of matrices, whose derivatives
are products, too (:class:`Series`), in NumPy: to trace and to load a program of all of it would take a command longer
than the trials do.
"""

from collections.abc import Collection
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.least_squares.gram import solve_normal
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import Array, cross_matrix, library_of
from uq.monte_carlo.gram_sums.case_equations import (
    NoiseExpectation,
    feature_map,
    symmetric,
)
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis, gyro_map
from uq.monte_carlo.gram_sums.packed_equations import packed_equations, solution_series
from uq.monte_carlo.gram_sums.run_sums import FeatureSums, RunSums
from uq.sources.constant_errors import Errors, no_errors, unravel


class Series(NamedTuple):
    """A matrix as a function of d numbers: its value and derivatives at a point. Products keep both orders."""

    value: Float[Array, "*shape"]
    first: Float[Array, "d *shape"]
    second: Float[Array, "d d *shape"]

    def __matmul__(self, other: "Series | np.ndarray") -> "Series":
        """Return the product with a matrix that is constant, or depends on the same numbers."""
        if not isinstance(other, Series):
            return Series(*(part @ other for part in self))
        # Leibniz: (A B)_ij = A_ij B + A_i B_j + A_j B_i + A B_ij
        crossed = self.first[:, None] @ other.first
        return Series(
            self.value @ other.value,
            self.first @ other.value + self.value @ other.first,
            self.second @ other.value + crossed + crossed.swapaxes(0, 1) + self.value @ other.second,
        )

    @property
    def T(self) -> "Series":  # noqa: N802 - as NumPy has it
        """The transposed matrix."""
        return Series(*(part.swapaxes(-1, -2) for part in self))


class ErrorMaps(NamedTuple):
    """Maps of a run's sums by constant errors: arrays, or their :class:`Series`."""

    features: Any
    """Matrix that gives the features of the measured omega from the elements, (13, 18)."""
    moment: Any
    """Matrix that gives the measured ``M - r × F`` from the basis and 1, (3, functions + 1)."""
    delay: Any
    """Delay of the gyro [s]."""


def error_maps(body: Body, platform: Platform, basis: WrenchBasis, errors: Errors) -> ErrorMaps:
    """Return the maps of the sums that constant errors make.

    Args:
        body: that is moved.
        platform: what carries it.
        basis: the functions of time of which the wrench is made.
        errors: of the experiment.
    """
    cell, bias = basis.map(body, platform, errors), errors.cell_bias[:, None]
    force, moment = library_of(cell, bias).concat([cell, bias], axis=1).reshape(2, 3, -1)
    return ErrorMaps(
        feature_map(gyro_map(errors), errors.gyro_bias, errors.gyro_drift),
        moment - cross_matrix(body.r_cg_from_q + errors.r_cg) @ force,
        errors.gyro_delay,
    )


@partial(jax.jit, static_argnames="fields")
def map_series(
    body: Body,
    platform: Platform,
    basis: WrenchBasis,
    expected: Float[Array, " e"],
    errors: Float[Array, "e d"],
    fields: Collection[str],
) -> ErrorMaps:
    """Return the maps as functions of the numbers that constant sources draw, about their expectation.

    Args:
        body: that is moved.
        platform: what carries it.
        basis: the functions of time of which the wrench is made.
        expected: errors, :class:`uq.sources.constant_errors.Errors` raveled.
        errors: how they follow from the d numbers that are drawn.
        fields: those of the errors that may not be zero; of the others nothing is computed.
    """

    def maps(numbers):
        acting = unravel(expected + errors @ numbers)._asdict()
        given = {field: acting[field] for field in fields}
        value = error_maps(body, platform, basis, no_errors()._replace(**given))
        return value, value

    def slopes(numbers):
        first, value = jax.jacfwd(maps, has_aux=True)(numbers)
        return first, (first, value)

    # forward over forward: the numbers are few, the entries of the maps many; value and slope come along
    second, (first, value) = jax.jacfwd(slopes, has_aux=True)(jnp.zeros(errors.shape[1]))
    leading = lambda derivative, order: jnp.moveaxis(derivative, range(-order, 0), range(order))  # noqa: E731
    return ErrorMaps(*(Series(a, leading(b, 1), leading(c, 2)) for a, b, c in zip(value, first, second, strict=True)))


def mapped_sums(maps: ErrorMaps, sums: FeatureSums) -> tuple[Any, Any]:
    """Return the sums of the measured features' products, and with the measured ``M - r × F``; likewise Series."""
    features = maps.features
    return features @ sums.gram @ features.T, features @ sums.wrench @ maps.moment.T


def delayed(sums: RunSums, delay: Series) -> FeatureSums:
    """Return an estimator's sums as functions of the numbers that move the delay of the gyro [s].

    By the chain rule, for a delay that is linear in them: ``S′ τ_i`` and ``S″ τ_i τ_j``. Where none of them moves it,
    as mostly, the sums stay plain matrices, which saves all their products' derivatives.
    """
    now = sums.at(delay.value)
    if not delay.first.any():
        return now
    slope = sums.derivative()
    first, second = slope.at(delay.value), slope.derivative().at(delay.value)
    by_delay = delay.first[:, None, None]
    orders = zip(now, (by_delay * x for x in first), (by_delay[:, None] * by_delay * x for x in second), strict=True)
    return FeatureSums._make(Series(*x) for x in orders)


class Expansion(NamedTuple):
    """The estimate about a point; of several estimators and cases, these lead."""

    value: Float[np.ndarray, "*n 6"]
    jacobian: Float[np.ndarray, "*n 6 d"]
    """Derivative of the tensor by the numbers that constant sources draw, in SI."""
    hessian: Float[np.ndarray, "*n 6 d d"]
    by_equations: Float[np.ndarray, "*n 6 27"]
    """Derivative of the tensor by the normal equations: the matrix's lower triangle, then the right-hand side."""
    twice_by_equations: Float[np.ndarray, "*n 6 27 27"]


def expand(maps: ErrorMaps, sums: RunSums, noise: NoiseExpectation) -> Expansion:
    """Expand one estimator's estimate about a point, to the second order.

    Args:
        maps: of the constant errors, as :class:`Series` about their expectation.
        sums: of the estimator over the run, without noise: their second order in the delay at least.
        noise: what the gyro's noise adds to expected sums; zero for the noise-free run.
    """
    gram, moment = mapped_sums(maps, delayed(sums, maps.delay))
    # the equations q are linear in the mapped sums, so that their derivatives are q of the sums' derivatives; then the
    # chain rule: x_ij = Σ_k x_k q_k,ij + Σ_kl x_kl q_k,i q_l,j
    equations, slopes, curvature = (packed_equations(*parts, noise) for parts in zip(gram, moment, strict=True))
    value, first, twice = solution_series(equations)
    hessian = np.moveaxis(curvature @ first.T, -1, 0) + slopes @ twice @ slopes.T
    return Expansion(
        value=value, jacobian=first @ slopes.T, hessian=hessian, by_equations=first, twice_by_equations=twice
    )


def tensor_of(equations: Float[Array, "27"]) -> Float[Array, "6"]:
    """Return the estimate from packed normal equations."""
    return solve_normal(symmetric(equations[:21]), equations[21:]).inertia


def _flat(stack: np.ndarray) -> np.ndarray:
    return stack.reshape(*stack.shape[:-2], -1)


class Moments(NamedTuple):
    """The estimate's moments by an expansion."""

    mean: Float[np.ndarray, "... 6"]
    first_order: Float[np.ndarray, "... 6 6"]
    covariance: Float[np.ndarray, "... 6 6"]


def propagate_case(
    expansion: Expansion,
    covariance: Float[np.ndarray, "... d d"],
    scatter: Float[np.ndarray, "... 27 27"],
    change: Float[np.ndarray, "... 27"] | None = None,
) -> Moments:
    """Return mean and covariance of estimates for normal errors.

    Args:
        expansion: about the errors' and sums' expectations, one for each of n cases.
        covariance: of the numbers that act; zero rows for those that do not.
        scatter: covariance of the normal equations under white noise.
        change: mean of the normal equations less those of the point; None: none.

    Returns:
        The mean with ``½ tr(H Σ)``; the covariance ``J Σ Jᵀ`` and that with ``½ tr(H Σ H Σ)`` (GUM 5.1.2), in the
        constant errors and in the sums. Products of a constant error's and the noise's effects are left out: relative
        to the noise's own they are of the square of the constant error's relative size.
    """
    mean, first, second = expansion.value, np.zeros(()), np.zeros(())
    _, *derivatives = expansion
    # GUM 5.1.2 and its note, for the constant errors, then for the sums: both are independent, so that their parts add
    for jacobian, hessian, sigma in zip(derivatives[::2], derivatives[1::2], (covariance, scatter), strict=True):
        curved = hessian @ sigma[..., None, :, :]
        mean = mean + 0.5 * np.trace(curved, axis1=-2, axis2=-1)
        first = first + jacobian @ sigma @ jacobian.swapaxes(-1, -2)
        # tr(A B) = Σ_kl A_kl B_lk: one product of flattened matrices for all pairs of components
        second = second + 0.5 * _flat(curved) @ _flat(curved.swapaxes(-1, -2)).swapaxes(-1, -2)
    if change is not None:
        mean = mean + (expansion.by_equations @ change[..., None])[..., 0]
    return Moments(mean, first, first + second)

"""Limits of trials on sums: noise of the gyro that is too large for them, and trials too skewed to be drawn as normal.

A trial on sums leaves out the noise's third powers, and takes what it draws as normal (:mod:`uq.trials.sums_engine`).
"""

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import Body
from uq.gram_sums.case_equations import NO_NOISE
from uq.gram_sums.packed_equations import (
    about_cg,
    cell_scatter,
    equations_of_products,
    expected_by_axes,
    packed_equations,
    solution_series,
)
from uq.gram_sums.run_moments import RunMoments
from uq.sources.noise_filters import WHITE, GyroNoise
from uq.trials.sums_setup import TrueRun

LARGEST_NOISE = 0.04
"""Root mean square of the gyro's noise over that of the motion, up to which the noise's third powers count for nothing:
at 0.12 they change 3σ by 8 %, and their effect goes with its square."""
LARGEST_SKEWNESS = 0.1
"""Skewness up to which trials are drawn as normal. Skewness γ moves the ends of a 95 % interval by γ/6 (1.96² - 1) of
the standard uncertainty (Cornish and Fisher), 2.4 % of the half-width."""
SKEWNESS = 4.0
"""Skewness of a sum of squares of noise times √n: √8 of independent ones, 1.36 times as much of differences."""


def beyond_sums(
    run: TrueRun, moments: RunMoments, noise: GyroNoise, cell: Float[np.ndarray, "6 6"], body: Body
) -> str | None:
    """Return why a case needs samples; None: sums tell it.

    Args:
        run: without noise.
        moments: of its sums.
        noise: of the gyro, in this case.
        cell: covariance of the load cell's white noise of one sample, in this case.
        body: that is moved.
    """
    variance = sum(np.trace(size) * moments.omega[f] for f, size in noise.parts.items())
    count = run.valid.sum()
    ratio = np.sqrt(variance / max(np.sum(np.square(run.signals[:3] * run.valid)) / count, 1e-300))
    if ratio > LARGEST_NOISE:
        return f"the gyro's noise is {100 * ratio:.2g} % of the motion"
    if noise.parts.keys() <= {WHITE} and SKEWNESS / np.sqrt(count) <= LARGEST_SKEWNESS:
        return None  # the largest that white noise can cause
    skewness = max(np.max(predicted_skewness(run, moments, noise, cell, body, k)) for k in range(len(run.taps)))
    if skewness > LARGEST_SKEWNESS:
        return f"the squares of the gyro's noise skew the trials by {skewness:.2g}"
    return None


def predicted_skewness(
    run: TrueRun, moments: RunMoments, noise: GyroNoise, cell: Float[np.ndarray, "6 6"], body: Body, estimator: int
) -> Float[np.ndarray, "6"]:
    """Return about the largest skewness of each component's estimate that the gyro's noise can cause.

    With effects linear (l) and quadratic (q) in it, the third cumulant is ``6 Jᵀ K H K J + 8 tr (H K)³``: of the size
    of ``√8 σ_q (σ_l² + σ_q²) / √n`` for n independent squares. A random walk has few of them. Beside them the load
    cell's noise counts, other errors not.
    """
    middle, features, r_cg = len(run.sums.gram) // 2, [*range(10), -3, -2, -1], np.asarray(body.r_cg_from_q)
    gram = np.asarray(run.sums.gram[middle, estimator])[np.ix_(features, features)]
    moment = np.asarray(run.sums.wrench[middle, estimator])[features, :6] @ about_cg(r_cg).T
    _, by_equations, _ = solution_series(packed_equations(gram, moment, NO_NOISE))
    by_product = by_equations @ equations_of_products(moments.algebra, estimator, r_cg)
    by_cell = cell_scatter(expected_by_axes(gram, NO_NOISE), cell, r_cg)

    def variance(slope: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        return np.einsum("ik,kl,il->i", slope, covariance, slope)

    linear, squares, third = variance(by_product, moments.linear_covariance(noise)), np.zeros(6), np.zeros(6)
    for filter_, size in noise.parts.items():
        part = GyroNoise({filter_: size}, noise.third_cumulant, noise.fourth_cumulant)
        quadratic = variance(by_product, moments.covariance(part) - moments.linear_covariance(part))
        independent = run.valid.sum() if filter_ == WHITE else 2.0
        third += SKEWNESS / np.sqrt(independent) * np.sqrt(np.maximum(quadratic, 0)) * (linear + quadratic)
        squares += quadratic
    total = linear + squares + variance(by_equations, by_cell)
    return np.divide(third, total**1.5, out=np.zeros(6), where=total > 0)

"""One tensor from several runs: their normal equations added, their scatter counted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.estimators.excitation import Excitation, excitation
from identify.estimators.run_information import Information
from identify.estimators.type_a import Pooling, Repeat, pooling
from identify.signals.run import RunError

NORMAL = 1.959963984540054
"""Coverage factor of 95 % of a normal distribution."""
CLEAR = 0.01
"""Part of a component in what is not excited that counts as none."""


class Pooled(NamedTuple):
    """The estimate from several runs together. What the motion does not excite is zero in all of it."""

    inertia: np.ndarray
    """Packed tensor from all runs [kg·m²]."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain [kg·m²]."""
    covariance: np.ndarray
    """Residuals, scatter between runs, centre of gravity, (6, 6) [(kg·m²)²]."""
    residual: np.ndarray
    """Part of ``covariance`` that the residuals predict, (6, 6) [(kg·m²)²]."""
    by_centre: np.ndarray
    """Derivative of the tensor with respect to r_CG, (6, 3)."""
    by_right: np.ndarray
    """Derivative of the tensor with respect to each run's right side, (k, 6, 6)."""
    together: Pooling
    """Type A evaluation: what residuals and the scatter between runs and mountings show."""
    half_width: np.ndarray
    """Half the interval of 95 % by component [kg·m²]: type A's, and the normal one of r_CG, added in squares."""
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom by component (GUM G.4; r_CG's uncertainty counts as known)."""
    excitation: Excitation
    """Components that the motions of all runs together determine."""

    @property
    def seen(self) -> np.ndarray:
        """The directions in the space of packed tensors that it does excite, (k, 6); small parts of them left out."""
        blind = self.excitation.directions[~self.excitation.identifiable]
        clear = np.where(np.abs(blind) < CLEAR, 0.0, blind)
        return np.linalg.qr(np.concatenate([clear, np.eye(6)]).T)[0].T[len(blind) :]

    @property
    def coverage_factor(self) -> np.ndarray:
        """Coverage factor of 95 %, by component."""
        return self.half_width / np.maximum(np.sqrt(np.diag(self.covariance)), 1e-300)


def pool(estimates: Sequence[Information], sigma_r_cg: np.ndarray) -> Pooled:
    """Return the tensor of several runs, each weighted by the inverse of its noise variance.

    Args:
        estimates: what each run says.
        sigma_r_cg: standard uncertainty of the centre of gravity on each axis [m].

    Raises:
        RunError: the motion tells nothing at all.
    """
    weights = np.array([estimate.weight for estimate in estimates])
    normal = np.einsum("k,kij->ij", weights, [estimate.normal for estimate in estimates])
    noise = np.einsum("k,kij->ij", weights, [estimate.noise for estimate in estimates])
    verdict = excitation(normal, noise)
    seen = verdict.directions[verdict.identifiable]
    if not len(seen):
        first, more = estimates[0].run, len(estimates) - 1
        names = ", ".join(verdict.unidentifiable)
        raise RunError(
            f"the motion in {first.name}{f' and {more} more' if more else ''} does not identify {names}: "
            f"{first.cure('rotate about more axes, or faster')}"
        )
    inverse = seen.T @ np.diag(1 / verdict.strength[verdict.identifiable]) @ seen
    inertia = inverse @ (weights @ [estimate.right for estimate in estimates])
    by_centre = inverse @ np.einsum("k,kij->ij", weights, [estimate.right_by_centre for estimate in estimates])
    residual = inverse @ np.einsum("k,kij->ij", weights**2, [estimate.scores for estimate in estimates]) @ inverse
    freedom_of_residuals = _degrees_of_freedom(estimates, weights, inverse)
    together = pooling(_repeats(estimates, weights, inertia), inverse, residual, freedom_of_residuals)
    noise_covariance, centre_covariance = together.covariance, by_centre * sigma_r_cg**2 @ by_centre.T
    covariance = noise_covariance + centre_covariance
    half = np.hypot(together.half_width, NORMAL * np.sqrt(np.diag(centre_covariance)))
    freedom = together.degrees_of_freedom * (np.diag(covariance) / np.maximum(np.diag(noise_covariance), 1e-300)) ** 2
    bias = seen.T @ (seen @ inertia - np.linalg.solve(seen @ (normal - noise) @ seen.T, seen @ normal @ inertia))
    share = weights * [estimate.rows for estimate in estimates]
    gain_error = share @ [estimate.gain_error for estimate in estimates] / share.sum()
    return Pooled(
        inertia=inertia, bias=bias + gain_error * inertia, covariance=covariance, residual=residual,
        by_centre=by_centre, by_right=weights[:, None, None] * inverse, together=together, half_width=half,
        degrees_of_freedom=np.clip(freedom, 1, 1e9), excitation=verdict,
    )  # fmt: skip


def _repeats(estimates: Sequence[Information], weights: np.ndarray, inertia: np.ndarray) -> list[Repeat]:
    """Return the data of each run for the evaluation of scatter."""
    return [
        Repeat(
            score=weight * (estimate.right - estimate.normal @ inertia), inertia=estimate.inertia,
            standard_uncertainty=np.sqrt(np.diag(estimate.covariance)),
            alone=bool(estimate.excitation.identifiable.all()), mounting=estimate.run.mounting,
        )
        for estimate, weight in zip(estimates, weights, strict=True)
    ]  # fmt: skip


def _degrees_of_freedom(estimates: Sequence[Information], weights: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Return effective degrees of freedom of the pooled tensor's variance from residuals, by component (GUM G.4)."""
    squares = np.array([w**2 * np.diag(inverse @ p.scores @ inverse) for w, p in zip(weights, estimates, strict=True)])
    terms = (squares**2 / [estimate.degrees_of_freedom for estimate in estimates]).sum(axis=0)
    return np.clip(squares.sum(axis=0) ** 2 / np.maximum(terms, 1e-300), 1, 1e9)

"""One tensor from several runs: their normal equations added, their scatter counted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.estimators.least_squares import Excitation, excitation
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


def pool(of_runs: Sequence[Information], sigma_r_cg: np.ndarray) -> Pooled:
    """Return the tensor of several runs, each weighted by the inverse of its noise variance.

    Args:
        of_runs: what each run says.
        sigma_r_cg: standard uncertainty of the centre of gravity on each axis [m].

    Raises:
        RunError: the motion tells nothing at all.
    """
    weights = np.array([of_run.weight for of_run in of_runs])
    normal = np.einsum("k,kij->ij", weights, [of_run.normal for of_run in of_runs])
    noise = np.einsum("k,kij->ij", weights, [of_run.noise for of_run in of_runs])
    verdict = excitation(normal, noise)
    seen = verdict.directions[verdict.identifiable]
    if not len(seen):
        first, more = of_runs[0].run, len(of_runs) - 1
        names = ", ".join(verdict.unidentifiable)
        raise RunError(
            f"the motion in {first.name}{f' and {more} more' if more else ''} does not identify {names}: "
            f"{first.cure('rotate about more axes, or faster')}"
        )
    inverse = seen.T @ np.diag(1 / verdict.strength[verdict.identifiable]) @ seen
    inertia = inverse @ (weights @ [of_run.right for of_run in of_runs])
    by_centre = inverse @ np.einsum("k,kij->ij", weights, [of_run.right_by_centre for of_run in of_runs])
    residual = inverse @ np.einsum("k,kij->ij", weights**2, [of_run.scores for of_run in of_runs]) @ inverse
    freedom_of_residuals = _degrees_of_freedom(of_runs, weights, inverse)
    together = pooling(_repeats(of_runs, weights, inertia), inverse, residual, freedom_of_residuals)
    of_noise, of_centre = together.covariance, by_centre * sigma_r_cg**2 @ by_centre.T
    covariance = of_noise + of_centre
    half = np.hypot(together.half_width, NORMAL * np.sqrt(np.diag(of_centre)))
    freedom = together.degrees_of_freedom * (np.diag(covariance) / np.maximum(np.diag(of_noise), 1e-300)) ** 2
    bias = seen.T @ (seen @ inertia - np.linalg.solve(seen @ (normal - noise) @ seen.T, seen @ normal @ inertia))
    share = weights * [of_run.rows for of_run in of_runs]
    gain_error = share @ [of_run.gain_error for of_run in of_runs] / share.sum()
    return Pooled(
        inertia=inertia, bias=bias + gain_error * inertia, covariance=covariance, residual=residual,
        by_centre=by_centre, by_right=weights[:, None, None] * inverse, together=together, half_width=half,
        degrees_of_freedom=np.clip(freedom, 1, 1e9), excitation=verdict,
    )  # fmt: skip


def _repeats(of_runs: Sequence[Information], weights: np.ndarray, inertia: np.ndarray) -> list[Repeat]:
    """Return the data of each run for the evaluation of scatter."""
    return [
        Repeat(
            score=weight * (of_run.right - of_run.normal @ inertia), inertia=of_run.inertia,
            standard_uncertainty=np.sqrt(np.diag(of_run.covariance)),
            alone=bool(of_run.excitation.identifiable.all()), mounting=of_run.run.mounting,
        )
        for of_run, weight in zip(of_runs, weights, strict=True)
    ]  # fmt: skip


def _degrees_of_freedom(of_runs: Sequence[Information], weights: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Return effective degrees of freedom of the pooled tensor's variance from residuals, by component (GUM G.4)."""
    squares = np.array([w**2 * np.diag(inverse @ p.scores @ inverse) for w, p in zip(weights, of_runs, strict=True)])
    terms = (squares**2 / [of_run.degrees_of_freedom for of_run in of_runs]).sum(axis=0)
    return np.clip(squares.sum(axis=0) ** 2 / np.maximum(terms, 1e-300), 1, 1e9)

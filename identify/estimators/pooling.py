"""One tensor from several runs: their normal equations added, their scatter counted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.estimators.information import Information
from identify.estimators.least_squares import Excitation, excitation
from identify.estimators.repeatability import Pooling, Repeat, pooling
from identify.signals.run import RunError

NORMAL = 1.959963984540054
"""Coverage factor of 95 % of a normal distribution."""
CLEAR = 0.01
"""Part of a component in what is not excited that counts as none."""


class Pooled(NamedTuple):
    """What runs say together. What the motion does not excite is zero in all of it."""

    inertia: np.ndarray
    """Packed tensor [kg·m²]."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain [kg·m²]."""
    covariance: np.ndarray
    """Residuals, scatter between runs, centre of gravity, (6, 6) [(kg·m²)²]."""
    residual: np.ndarray
    """The part of it that the residuals say."""
    by_centre: np.ndarray
    """Derivative of the tensor with respect to r_CG, (6, 3)."""
    together: Pooling
    """Type A: what residuals and the scatter between runs and mountings say."""
    half_width: np.ndarray
    """Half the interval of 95 % by component [kg·m²]: type A's, and the normal one of r_CG, added in squares."""
    degrees_of_freedom: np.ndarray
    """Effective, by component (GUM G.4; r_CG's uncertainty counts as known)."""
    excitation: Excitation
    """What the motions together excite."""

    @property
    def seen(self) -> np.ndarray:
        """The directions in the space of packed tensors that it does excite, (k, 6); small parts of them left out."""
        blind = self.excitation.directions[~self.excitation.identifiable]
        clear = np.where(np.abs(blind) < CLEAR, 0.0, blind)
        return np.linalg.qr(np.concatenate([clear, np.eye(6)]).T)[0].T[len(blind) :]

    @property
    def coverage_factor(self) -> np.ndarray:
        """By component, of 95 %."""
        return self.half_width / np.maximum(np.sqrt(np.diag(self.covariance)), 1e-300)


def pool(parts: Sequence[Information], sigma_r_cg: np.ndarray) -> Pooled:
    """Return the tensor of several runs, each weighted by the inverse of its noise variance.

    Args:
        parts: what each run says.
        sigma_r_cg: standard uncertainty of the centre of gravity on each axis [m].

    Raises:
        RunError: the motion tells nothing at all.
    """
    weights = np.array([part.weight for part in parts])
    normal = np.einsum("k,kij->ij", weights, [part.normal for part in parts])
    noise = np.einsum("k,kij->ij", weights, [part.noise for part in parts])
    verdict = excitation(normal, noise)
    seen = verdict.directions[verdict.identifiable]
    if not len(seen):
        first, more = parts[0].run.name, len(parts) - 1
        names = ", ".join(verdict.unidentifiable)
        raise RunError(
            f"the motion in {first}{f' and {more} more' if more else ''} does not identify {names}: "
            "rotate about more axes, or faster"
        )
    inverse = seen.T @ np.diag(1 / verdict.strength[verdict.identifiable]) @ seen
    inertia = inverse @ (weights @ [part.right for part in parts])
    by_centre = inverse @ np.einsum("k,kij->ij", weights, [part.right_by_centre for part in parts])
    residual = inverse @ np.einsum("k,kij->ij", weights**2, [part.scores for part in parts]) @ inverse
    own = _degrees_of_freedom(parts, weights, inverse)
    together = pooling(_repeats(parts, weights, inertia), inverse, residual, own)
    of_noise, of_centre = together.covariance, by_centre * sigma_r_cg**2 @ by_centre.T
    covariance = of_noise + of_centre
    half = np.hypot(together.half_width, NORMAL * np.sqrt(np.diag(of_centre)))
    freedom = together.degrees_of_freedom * (np.diag(covariance) / np.maximum(np.diag(of_noise), 1e-300)) ** 2
    bias = seen.T @ (seen @ inertia - np.linalg.solve(seen @ (normal - noise) @ seen.T, seen @ normal @ inertia))
    share = weights * [part.rows for part in parts]
    gain_error = share @ [part.gain_error for part in parts] / share.sum()
    return Pooled(
        inertia,
        bias + gain_error * inertia,
        covariance,
        residual,
        by_centre,
        together,
        half,
        np.clip(freedom, 1, 1e9),
        verdict,
    )


def _repeats(parts: Sequence[Information], weights: np.ndarray, inertia: np.ndarray) -> list[Repeat]:
    """What the evaluation of scatter needs of each run."""
    return [
        Repeat(
            weight * (part.right - part.normal @ inertia), part.inertia, np.sqrt(np.diag(part.covariance)),
            bool(part.excitation.identifiable.all()), part.run.mounting,
        )
        for part, weight in zip(parts, weights, strict=True)
    ]  # fmt: skip


def _degrees_of_freedom(parts: Sequence[Information], weights: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Effective, of the pooled tensor's variance from the runs' residuals, by component (GUM G.4)."""
    squares = np.array([w**2 * np.diag(inverse @ p.scores @ inverse) for w, p in zip(weights, parts, strict=True)])
    terms = (squares**2 / [part.degrees_of_freedom for part in parts]).sum(axis=0)
    return np.clip(squares.sum(axis=0) ** 2 / np.maximum(terms, 1e-300), 1, 1e9)

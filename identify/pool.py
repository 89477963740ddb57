"""One tensor from several runs: their normal equations added, their scatter counted."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from identify.estimate import Information
from identify.pooling import Pooling, Repeat, pooling
from identify.run import RunError
from identify.solve import Excitation, excitation

CLEAR = 0.01
"""Part of a component in what is not excited that counts as none."""


class Pooled(NamedTuple):
    """What runs say together. What the motion does not excite is zero in all of it."""

    inertia: np.ndarray
    """Packed tensor [kg·m²]."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain [kg·m²]."""
    type_a: Pooling
    """What residuals and scatter between the runs say of its error."""
    by_centre: np.ndarray
    """Derivative of the tensor with respect to r_CG, (6, 3)."""
    of_centre: np.ndarray
    """Covariance from r_CG's uncertainty, (6, 6) [(kg·m²)²]."""
    excitation: Excitation
    """What the motions together excite."""

    @property
    def covariance(self) -> np.ndarray:
        """Residuals, scatter between runs, centre of gravity, (6, 6) [(kg·m²)²]."""
        return self.type_a.covariance + self.of_centre

    @property
    def half_width(self) -> np.ndarray:
        """Half the interval of 95 % of each component [kg·m²]."""
        return np.hypot(self.type_a.half_width, norm.ppf(0.975) * np.sqrt(np.diag(self.of_centre)))

    @property
    def degrees_of_freedom(self) -> np.ndarray:
        """Effective, by component (GUM G.4): r_CG's are known."""
        own = np.maximum(np.diag(self.type_a.covariance), 1e-300)
        return np.clip(self.type_a.degrees_of_freedom * (np.diag(self.covariance) / own) ** 2, 1, 1e9)

    @property
    def seen(self) -> np.ndarray:
        """The directions in the space of packed tensors that it does excite, (k, 6); small parts of them left out."""
        blind = self.excitation.directions[~self.excitation.identifiable]
        clear = np.where(np.abs(blind) < CLEAR, 0.0, blind)
        return np.linalg.qr(np.concatenate([clear, np.eye(6)]).T)[0].T[len(blind) :]


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
    bias = seen.T @ (seen @ inertia - np.linalg.solve(seen @ (normal - noise) @ seen.T, seen @ normal @ inertia))
    share = weights * [part.rows for part in parts]
    gain_error = share @ [part.gain_error for part in parts] / share.sum()
    return Pooled(
        inertia,
        bias + gain_error * inertia,
        _type_a(parts, weights, inertia, inverse),
        by_centre,
        by_centre * sigma_r_cg**2 @ by_centre.T,
        verdict,
    )


def _type_a(parts: Sequence[Information], weights: np.ndarray, inertia: np.ndarray, inverse: np.ndarray) -> Pooling:
    """Residuals, with their effective degrees of freedom by component (GUM G.4), and scatter."""
    residual = inverse @ np.einsum("k,kij->ij", weights**2, [part.scores for part in parts]) @ inverse
    squares = np.array([w**2 * np.diag(inverse @ p.scores @ inverse) for w, p in zip(weights, parts, strict=True)])
    terms = (squares**2 / [part.degrees_of_freedom for part in parts]).sum(axis=0)
    repeats = [
        Repeat(
            weight * (part.right - part.normal @ inertia),
            part.inertia,
            np.sqrt(np.diag(part.covariance)),
            bool(part.excitation.identifiable.all()),
            part.run.mounting,
        )
        for part, weight in zip(parts, weights, strict=True)
    ]
    freedom = np.clip(squares.sum(axis=0) ** 2 / np.maximum(terms, 1e-300), 1, 1e9)
    return pooling(repeats, inverse, residual, freedom)

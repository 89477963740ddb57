"""Least squares over static poses: the ten parameters' linear form ``(m, F0, m r, M0)`` with its covariance.

Force and moment are fitted without weights. What the fit leaves has a covariance of its own across the six axes, W,
since one axis of a load cell may be three times as noisy as another and an error of attitude shows in force and moment
at once: the estimate's covariance is ``Σ G_i W G_iᵀ`` over the poses, G the least squares' gain. Errors that are common
to all poses do not show in the residuals and come on top.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.rigid_body.regressor import cross_matrices

CHANNELS = 6
LINEAR = 10


@dataclass(frozen=True)
class Attitudes:
    """Uncertainty of the attitudes of static poses."""

    tilt: Float[np.ndarray, " n"] | float = 0.0
    """Standard uncertainty of each pose's tilt about any axis, independent from pose to pose [rad]."""
    common: Float[np.ndarray, "n 3 k"] | None = None
    """Change of each pose's specific force f by one standard uncertainty of k errors that all poses share [m/s²]; None:
    none."""
    lasting: int = 0
    """Number of errors, the first columns of ``common``, that stay as they are from one series of poses to the next."""
    wrench: Float[np.ndarray, "n 6 e"] | None = None
    """Change of each pose's wrench by one standard uncertainty of e independent errors of load cell or gravity [N,
    N·m], which last from series to series; None: none."""

    def of(self, poses: Bool[np.ndarray, " n"]) -> "Attitudes":
        """Return those of some of the poses."""
        tilt = np.broadcast_to(np.asarray(self.tilt, float), len(poses))[poses]
        common, wrench = (None if x is None else x[poses] for x in (self.common, self.wrench))
        return Attitudes(tilt, common, self.lasting, wrench)


EXACT = Attitudes()


class PoseSignals(NamedTuple):
    """Measured wrench and attitude of static poses, in B."""

    force: Float[np.ndarray, "n 3"]
    """Mean force on the body [N]."""
    moment: Float[np.ndarray, "n 3"]
    """Mean moment on the body about Q [N·m]."""
    specific_force: Float[np.ndarray, "n 3"]
    """Specific force, opposite to gravity [m/s²]."""


@dataclass(frozen=True)
class PoseFit:
    """Least squares over static poses."""

    values: Float[np.ndarray, "10"]
    """Estimated linear parameters (m, F0, m r, M0)."""
    covariance: Float[np.ndarray, "10 10"]
    residuals: Float[np.ndarray, "n 6"]
    degrees_of_freedom: Float[np.ndarray, "10"]
    """Effective degrees of freedom of each standard uncertainty (Welch–Satterthwaite, GUM G.4.1)."""
    lasting: Float[np.ndarray, "10 k"]
    """Change of the values by lasting errors of one standard uncertainty each."""
    gain: Float[np.ndarray, "10 n 6"]
    """Derivative of the values by the wrench of each pose."""
    memory: Float[np.ndarray, " c"]
    """Coefficients of the wrench's further columns."""
    memory_uncertainty: Float[np.ndarray, " c"]
    """Standard uncertainties of ``memory``."""
    leverage: Float[np.ndarray, "n 6"]
    """Derivative of each fitted reading by the measured one: the diagonal of the hat matrix."""

    def predicted(
        self, specific_force: Float[np.ndarray, "k 3"], memory: Float[np.ndarray, "k 6 c"] | None = None
    ) -> Float[np.ndarray, "k 6"]:
        """Return the wrench that the fit predicts for poses."""
        wrench = _rows(specific_force) @ self.values
        return wrench if memory is None else wrench + memory @ self.memory


def fit(
    signals: PoseSignals,
    attitudes: Attitudes,
    used: Bool[np.ndarray, " n"],
    *,
    mass: tuple[float, float] | None = None,
    memory: Float[np.ndarray, "n 6 c"] | None = None,
) -> PoseFit:
    """Return the least squares of ``F = m f + F0`` and ``M = (m r) × f + M0``.

    Args:
        signals: of all poses.
        attitudes: how far their specific force may be off.
        used: which of the poses count.
        mass: from a scale, with its standard uncertainty, as one more observation [kg].
        memory: further columns of the wrench, whose coefficients are estimated along.
    """
    attitudes, specific_force = attitudes.of(used), signals.specific_force[used]
    rows, measured = _rows(specific_force), np.hstack([signals.force, signals.moment])[used]
    if memory is not None:
        rows = np.concatenate([rows, memory[used]], axis=2)
    gain = _gain(rows)
    values = np.einsum("pnc,nc->p", gain, measured)
    residuals = measured - rows @ values
    leverage = np.einsum("ncp,pnc->nc", rows, gain)
    free = np.maximum(len(rows) - leverage.sum(axis=0), 0.1)
    tilts, by_attitude = _attitude_effects(values, gain, specific_force, attitudes)
    by_cell = np.zeros((len(gain), 0)) if attitudes.wrench is None else np.einsum("pnc,nck->pk", gain, attitudes.wrench)
    lasting = attitudes.lasting + by_cell.shape[1]
    common_effect = np.hstack([by_attitude[:, : attitudes.lasting], by_cell, by_attitude[:, attitudes.lasting :]])
    scatter = _scatter(residuals, free, tilts)
    if mass is not None:
        factor, mass_gain = _observed(_covariance(gain, scatter, tilts, common_effect), mass[1])
        values = factor @ values + mass_gain * mass[0]
        gain = np.einsum("pq,qnc->pnc", factor, gain)
        common_effect = np.column_stack([factor @ common_effect, mass_gain * mass[1]])
    covariance = _covariance(gain, scatter, tilts, common_effect)
    degrees = _degrees(gain, scatter, float(free.min()), np.diag(covariance))
    ten, more = slice(LINEAR), slice(LINEAR, None)
    return PoseFit(
        values=values[ten], covariance=covariance[ten, ten], residuals=measured - rows @ values,
        degrees_of_freedom=degrees[ten], lasting=common_effect[ten, :lasting], gain=gain[ten], memory=values[more],
        memory_uncertainty=np.sqrt(np.diag(covariance)[more]), leverage=leverage,
    )  # fmt: skip


def predicted_covariance(
    values: Float[np.ndarray, "10"],
    specific_force: Float[np.ndarray, "n 3"],
    scatter: Float[np.ndarray, "6 6"],
    attitudes: Attitudes,
) -> Float[np.ndarray, "10 10"]:
    """Return the covariance that the least squares of poses will have that are not measured yet.

    Args:
        values: expected (m, F0, m r, M0).
        specific_force: of the poses, opposite to gravity [m/s²].
        scatter: covariance of each pose's mean force and moment.
        attitudes: how far the poses' attitudes may be off.
    """
    gain = _gain(_rows(specific_force))
    tilts, common_effect = _attitude_effects(values, gain, specific_force, attitudes)
    return _covariance(gain, scatter, tilts, common_effect)


def shrunk(covariance: Float[np.ndarray, "k k"], free: float) -> Float[np.ndarray, "k k"]:
    """Return a sample covariance whose correlations are shrunk by as much as their own noise asks for.

    The intensity is that of Schäfer and Strimmer (2005), doi:10.2202/1544-6115.1175, target D of their table: few poses
    show correlations where there are none, and trust in these would be false confidence in some combination of axes.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    same = np.eye(len(covariance))
    square = np.minimum((covariance / np.outer(sigma, sigma)) ** 2, 1) * (1 - same)
    noise = ((1 - square) ** 2 * (1 - same)).sum() / max(free, 1.0)
    share = 1 - min(1.0, noise / max(square.sum(), 1e-300))
    return covariance * (share + (1 - share) * same)


def _rows(f: np.ndarray) -> np.ndarray:
    """The regressor of the wrench over (m, F0, m r, M0), (n, 6, 10)."""
    rows = np.zeros((len(f), CHANNELS, LINEAR))
    rows[:, :3, 0], rows[:, :3, 1:4] = f, np.eye(3)
    rows[:, 3:, 4:7], rows[:, 3:, 7:] = -cross_matrices(f), np.eye(3)
    return rows


def _gain(rows: np.ndarray) -> np.ndarray:
    """The least squares' gain from the measured wrenches to the values, (p, n, 6)."""
    count = rows.shape[2]
    return np.linalg.pinv(rows.reshape(-1, count)).reshape(count, -1, CHANNELS)


def _attitude_effects(
    values: np.ndarray, gain: np.ndarray, f: np.ndarray, attitudes: Attitudes
) -> tuple[np.ndarray, np.ndarray]:
    """Return a standard uncertainty's effects: of each tilt on its wrench (n, 6, 3), of common errors on the values."""
    sigma = np.broadcast_to(np.asarray(attitudes.tilt, float), len(f))[:, None, None]
    common = np.zeros((len(f), 3, 0)) if attitudes.common is None else attitudes.common
    tilts = _wrench_change(values, -cross_matrices(f)) * sigma
    return tilts, np.einsum("pnc,nck->pk", gain, _wrench_change(values, common))


def _wrench_change(values: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Change of the fitted wrench (n, 6, k) by changes (n, 3, k) of the specific force."""
    moment = np.cross(values[4:7], change, axisb=1, axisc=1)
    return np.concatenate([values[0] * change, moment], axis=1)


def _positive(matrix: np.ndarray) -> np.ndarray:
    """The matrix without its negative part."""
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.maximum(values, 0) @ vectors.T


def _scatter(residuals: np.ndarray, free: np.ndarray, tilts: np.ndarray) -> np.ndarray:
    """Covariance of the residuals across the six axes, less that of the declared tilts."""
    shrunk_covariance = shrunk(residuals.T @ residuals / np.sqrt(np.outer(free, free)), float(free.min()))
    return _positive(shrunk_covariance - np.einsum("nck,ndk->cd", tilts, tilts) / len(residuals))


def _observed(covariance: np.ndarray, sigma: float) -> tuple[np.ndarray, np.ndarray]:
    """One more observation, of the first value: factor of the estimate before it, and gain of the observation."""
    gain = covariance[:, 0] / (covariance[0, 0] + sigma**2)
    return np.eye(len(gain)) - np.outer(gain, np.eye(len(gain))[0]), gain


def _covariance(gain: np.ndarray, scatter: np.ndarray, tilts: np.ndarray, common_effect: np.ndarray) -> np.ndarray:
    """Covariance of the estimate: from the residuals, each pose's tilt, and errors common to all."""
    tilt_effect = np.einsum("pnc,nck->pnk", gain, tilts).reshape(len(gain), -1)
    from_scatter = np.einsum("pnc,cd,qnd->pq", gain, scatter, gain)
    return from_scatter + tilt_effect @ tilt_effect.T + common_effect @ common_effect.T


def _degrees(gain: np.ndarray, scatter: np.ndarray, free: float, variance: np.ndarray) -> np.ndarray:
    """Return effective degrees of freedom: those of ``tr(A W)``, W estimated with ``free``, in the whole variance."""
    weights = np.einsum("pnc,pnd->pcd", gain, gain) @ scatter
    square = np.einsum("pcd,pdc->p", weights, weights)
    return np.where(square > 0, free * variance**2 / np.where(square > 0, square, 1.0), np.inf)

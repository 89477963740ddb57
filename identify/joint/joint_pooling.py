"""Several runs of one body and one rig: what they share is estimated from all of them, with the prior taken once.

Each run's solution is expanded to second order, the unknowns of that run alone are eliminated (Schur complement), and
the rest adds up.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identify.joint.priors import ConstantError, indices
from identify.joint.single_run import JointRun
from identify.sums.row_products import SharedEquations, eliminated

ALIGNED = ("inertia", "mass", "r_cg", "delay", "rotation")
"""Unknowns that all runs of one body and one rig share."""
CALIBRATED = ("force_offset", "moment_offset")
"""Unknowns that runs share, too, where one static calibration precedes all of them."""


class PooledJoint(NamedTuple):
    """The estimate from all runs."""

    theta: list[np.ndarray]
    """Unknowns of each run; shared ones are equal in all runs."""
    covariance: np.ndarray
    """Covariance of the unknowns of the first run, (count, count)."""
    from_prior: np.ndarray
    """Part of ``covariance`` that the errors of the prior cause, (count, count)."""
    scatter: float
    """Ratio of the scatter between runs to the scatter that their noise predicts; 1 for a single run."""
    degrees_of_freedom: float
    """Degrees of freedom of ``scatter``; infinite for a single run."""
    by_prior: np.ndarray
    """Derivative of the first run's unknowns by the prior mean of each shared unknown, (count, count)."""


def shared_unknowns(errors: Mapping[str, ConstantError], *, calibrated: bool) -> set[str]:
    """Return the names of the unknowns that all runs share.

    Args:
        errors: declared constant errors by the name of their source.
        calibrated: whether one static calibration precedes all runs.
    """
    declared = {error.unknown for error in errors.values() if error.shared}
    return {*ALIGNED, *(CALIBRATED if calibrated else ()), *declared, "cg_from_still"}


def pool(runs: Sequence[JointRun], shared: Iterable[str]) -> PooledJoint:
    """Pool the runs' estimates.

    Args:
        runs: their estimates, made with the same prior.
        shared: names of the unknowns that are the same in all.
    """
    root, counted = runs[0].prior.root, runs[0].prior.counted
    common = np.abs(root[indices(shared)]).max(axis=0) > 0 if len(runs) > 1 else np.ones(len(counted), bool)
    reduced = [_shared_equations(run, common) for run in runs]
    total, right = sum(equations.matrix for equations in reduced), sum(equations.right for equations in reduced)
    precision = np.diag(counted[common])
    inverse = np.linalg.inv(total + precision)
    z = inverse @ right
    scatter, freedom = _scatter(reduced, z)
    spread = scatter**2 * inverse @ total @ inverse + inverse @ precision @ inverse
    theta = []
    for run, equations in zip(runs, reduced, strict=True):
        values = np.empty(len(common))
        values[common], values[~common] = z[:, 0], (equations.by_right + equations.by_shared @ z)[:, 0]
        theta.append(run.prior.theta(values))
    first = reduced[0]
    carried = np.zeros((len(common), len(z)))
    carried[common], carried[~common] = np.eye(len(z)), first.by_shared
    carried = root @ carried
    covariance = carried @ spread @ carried.T + root[:, ~common] @ first.covariance @ root[:, ~common].T
    from_prior = carried @ inverse @ precision @ inverse @ carried.T
    by_prior = carried @ inverse @ precision @ np.linalg.pinv(root)[common]
    return PooledJoint(
        theta=theta, covariance=covariance, from_prior=from_prior, scatter=scatter,
        degrees_of_freedom=freedom, by_prior=by_prior,
    )  # fmt: skip


def _shared_equations(run: JointRun, common: np.ndarray) -> SharedEquations:
    counted, data = run.prior.counted, run.fit.information
    right = (data + np.diag(counted)) @ run.fit.z
    return eliminated(data + np.diag(np.where(common, 0.0, counted)), right[:, None], common)


def _scatter(reduced: Sequence[SharedEquations], z: np.ndarray) -> tuple[float, float]:
    """Root of the runs' mean squared departure from the pooled estimate in units of their noise, at least 1."""
    if len(reduced) == 1:
        return 1.0, np.inf
    squares, rank = 0.0, 0
    for equations in reduced:
        residual = (equations.right - equations.matrix @ z)[:, 0]
        squares += float(residual @ np.linalg.pinv(equations.matrix, rcond=1e-10, hermitian=True) @ residual)
        rank += int(np.linalg.matrix_rank(equations.matrix, rtol=1e-10, hermitian=True))
    freedom = max(rank * (len(reduced) - 1) / len(reduced), 1.0)
    return max(float(np.sqrt(squares / freedom)), 1.0), freedom

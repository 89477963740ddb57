"""Several runs of one body and one rig: what they share is estimated from all of them, the prior counting once.

Each run's solution is expanded to second order, what is its own is eliminated (Schur complement), and the rest adds up.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.joint.priors import indices
from identify.joint.single_run import JointRun

ALIGNED = ("inertia", "mass", "r_cg", "delay", "rotation")
"""What runs of one body and one rig share."""
CALIBRATED = ("force_offset", "moment_offset")
"""What they share, too, where a static calibration stands before all of them."""


class Pooled(NamedTuple):
    """The estimate from all runs."""

    theta: list[np.ndarray]
    """Each run's unknowns, those that are shared being equal."""
    covariance: np.ndarray
    """Of the unknowns of the first run, (count, count)."""
    of_prior: np.ndarray
    """The part of it that the errors of what was known before cause."""
    scatter: float
    """How much more the runs scatter than their own noise says; 1 for one run."""
    degrees_of_freedom: float
    """Of the scatter; infinite for one run."""


def pool(runs: Sequence[JointRun], shared: Sequence[str]) -> Pooled:
    """Pool the runs' estimates.

    Args:
        runs: their estimates, made with the same prior.
        shared: names of the unknowns that are the same in all.
    """
    if len(runs) == 1:
        covariance, of_prior = runs[0].posterior()
        return Pooled([runs[0].theta], covariance, of_prior, 1.0, np.inf)
    root, counted = np.asarray(runs[0].prior.root), np.asarray(runs[0].prior.counted)
    common = np.abs(root[indices(shared)]).max(axis=0) > 0
    reduced = [_eliminated(run, common) for run in runs]
    total, right = sum(equations.matrix for equations in reduced), sum(equations.right for equations in reduced)
    precision = np.diag(counted[common])
    inverse = np.linalg.inv(total + precision)
    z = inverse @ right
    scatter, freedom = _scatter(reduced, z)
    spread = scatter**2 * inverse @ total @ inverse + inverse @ precision @ inverse
    theta, covariance, of_prior = [], np.zeros_like(root @ root.T), np.zeros_like(root @ root.T)
    for run, equations in zip(runs, reduced, strict=True):
        whole = np.empty(len(common))
        whole[common], whole[~common] = z, equations.own @ np.concatenate([[1.0], z])
        theta.append(np.asarray(run.prior.mean) + np.asarray(run.prior.root) @ whole)
    first = reduced[0]
    carried = np.zeros((len(common), int(common.sum())))
    carried[common], carried[~common] = np.eye(int(common.sum())), first.own[:, 1:]
    covariance = root @ carried @ spread @ carried.T @ root.T
    covariance += root[:, ~common] @ first.own_covariance @ root[:, ~common].T
    of_prior = root @ carried @ inverse @ precision @ inverse @ carried.T @ root.T
    return Pooled(theta, covariance, of_prior, scatter, freedom)


class _Eliminated(NamedTuple):
    """A run's normal equations of what is shared, and how its own follows."""

    matrix: np.ndarray
    right: np.ndarray
    own: np.ndarray
    """Its own z as ``own @ (1, shared z)``."""
    own_covariance: np.ndarray
    """Of its own z, given the shared."""


def _eliminated(run: JointRun, common: np.ndarray) -> _Eliminated:
    counted, z = np.asarray(run.prior.counted), np.asarray(run.fit.z)
    data = np.asarray(run.fit.of_data)
    right = (data + np.diag(counted)) @ z
    matrix = data + np.diag(np.where(common, 0.0, counted))
    cross = matrix[np.ix_(common, ~common)]
    inverse = np.linalg.inv(matrix[np.ix_(~common, ~common)])
    return _Eliminated(
        matrix[np.ix_(common, common)] - cross @ inverse @ cross.T, right[common] - cross @ inverse @ right[~common],
        np.hstack([(inverse @ right[~common])[:, None], -inverse @ cross.T]), inverse,
    )  # fmt: skip


def _scatter(reduced: Sequence[_Eliminated], z: np.ndarray) -> tuple[float, float]:
    """Root of the runs' mean squared departure from the pooled estimate in units of their noise, at least 1."""
    squares, rank = 0.0, 0
    for equations in reduced:
        left = equations.right - equations.matrix @ z
        squares += float(left @ np.linalg.pinv(equations.matrix, rcond=1e-10, hermitian=True) @ left)
        rank += int(np.linalg.matrix_rank(equations.matrix, rtol=1e-10, hermitian=True))
    freedom = max(rank * (len(reduced) - 1) / len(reduced), 1.0)
    return max(float(np.sqrt(squares / freedom)), 1.0), freedom

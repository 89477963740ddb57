"""Several runs of one body and one rig: what they share is estimated from all of them, with the prior taken once.

Each run's solution is expanded to second order, the unknowns of that run alone are eliminated (Schur complement), and
the rest adds up. Where runs name their mountings, unknowns that each mounting draws are eliminated with those of its
runs, and the scatter is that between mountings.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identify.estimation.joint.priors import ConstantError, indices
from identify.estimation.joint.single_run import SolvedRun
from identify.least_squares.row_products import SharedEquations, eliminated

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
    from_mountings: np.ndarray
    """Part of ``covariance`` by the prior of unknowns that each mounting draws, (count, count)."""
    scatter: float
    """Ratio of the scatter between runs, or mountings, to that which their noise predicts; 1 for a single one."""
    degrees_of_freedom: float
    """Degrees of freedom of ``scatter``; infinite for a single run."""
    by_prior: np.ndarray
    """Derivative of the first run's unknowns by the prior mean of each shared unknown, (count, count)."""
    shared: np.ndarray
    """Mask of the prior's coordinates that all runs share, (free,)."""
    information: np.ndarray
    """Information of all runs on these coordinates, without their prior, (shared, shared)."""
    right: np.ndarray
    """Right-hand side that goes with ``information``, (shared,)."""


def shared_unknowns(
    errors: Mapping[str, ConstantError], *, calibrated: bool, drawn_by_mounting: Collection[str] = ()
) -> set[str]:
    """Return the names of the unknowns that all runs share.

    Args:
        errors: declared constant errors by the name of their source.
        calibrated: whether one static calibration precedes all runs.
        drawn_by_mounting: unknowns that are others in each mounting.
    """
    declared = {error.unknown for error in errors.values() if error.shared}
    return {*ALIGNED, *(CALIBRATED if calibrated else ()), *declared, "cg_from_still"} - set(drawn_by_mounting)


def pool(runs: Sequence[SolvedRun], shared: Iterable[str], drawn_by_mounting: Iterable[str] = ()) -> PooledJoint:
    """Pool the runs' estimates.

    Args:
        runs: their estimates, made with the same prior.
        shared: names of the unknowns that are the same in all.
        drawn_by_mounting: names of those that are the same in the runs of one mounting.
    """
    root, counted = runs[0].prior.root, runs[0].prior.counted
    common = _coordinates(runs, shared) if len(runs) > 1 else np.ones(len(counted), bool)
    by_mounting = _coordinates(runs, drawn_by_mounting) & ~common
    names = [run.run.mounting for run in runs]
    labels = dict.fromkeys(names)
    groups = [[k for k, name in enumerate(names) if name == label] for label in labels]
    groups = groups if len(labels) > 1 else [[k] for k in range(len(runs))]
    # each cluster eliminates what is its own, so that only equations of the shared unknowns are added
    clusters = [_Cluster([runs[k] for k in group], common, by_mounting) for group in groups]
    reduced = [cluster.equations() for cluster in clusters]
    total = np.sum([equations.matrix for equations in reduced], axis=0)
    right = np.sum([equations.right for equations in reduced], axis=0)
    precision = np.diag(counted[common])
    # the prior counts once, however many runs share it
    inverse = np.linalg.inv(total + precision)
    z = inverse @ right
    scatter, freedom = _scatter(reduced, z)
    # scatter between clusters widens what the data tell, not what is declared
    spread = scatter**2 * inverse @ total @ inverse + inverse @ precision @ inverse
    theta: dict[int, np.ndarray] = {}
    for group, cluster, equations in zip(groups, clusters, reduced, strict=True):
        others = (equations.by_right + equations.by_shared @ z)[:, 0]
        theta |= {k: runs[k].prior.theta(cluster.values(n, z[:, 0], others)) for n, k in enumerate(group)}
    # back substitution: a change of the shared unknowns carries the first run's own along
    first, others = reduced[0], clusters[0].others(0)
    carried = np.zeros((len(common), len(z)))
    carried[common], carried[~common] = np.eye(len(z)), first.by_shared[others]
    carried = root @ carried
    alone = root[:, ~common] @ first.covariance[np.ix_(others, others)] @ root[:, ~common].T
    by_drawn = [equations.by_shared[: by_mounting.sum()] @ inverse @ carried.T for equations in reduced]
    return PooledJoint(
        theta=[theta[k] for k in range(len(runs))], covariance=carried @ spread @ carried.T + alone,
        from_prior=carried @ inverse @ precision @ inverse @ carried.T,
        from_mountings=scatter**2 * np.sum([change.T @ change for change in by_drawn], axis=0),
        scatter=scatter, degrees_of_freedom=freedom,
        # z follows the prior's mean m by (I + P)⁻¹ P root⁺ m
        by_prior=carried @ inverse @ precision @ np.linalg.pinv(root)[common],
        shared=common, information=total, right=right[:, 0],
    )  # fmt: skip


def _coordinates(runs: Sequence[SolvedRun], names: Iterable[str]) -> np.ndarray:
    """Mask of the prior's coordinates that change some unknowns."""
    places = [place for name in names for place in indices([name])]
    return np.abs(runs[0].prior.root[places]).max(axis=0, initial=0.0) > 0


class _Cluster:
    """Runs of one mounting: unknowns that all runs share come first, then those of the mounting, then of each run."""

    def __init__(self, runs: Sequence[SolvedRun], common: np.ndarray, by_mounting: np.ndarray) -> None:
        self.runs, self.common, self.by_mounting = runs, common, by_mounting
        self.alone = ~(common | by_mounting)

    def places(self, number: int) -> np.ndarray:
        """Places of a run's coordinates among those of the cluster."""
        places, count = np.empty(len(self.common), int), self.alone.sum()
        before = self.common.sum() + self.by_mounting.sum()
        places[self.common], places[self.by_mounting] = (
            np.arange(self.common.sum()),
            np.arange(self.common.sum(), before),
        )
        places[self.alone] = before + number * count + np.arange(count)
        return places

    def others(self, number: int) -> np.ndarray:
        """Places of the coordinates of a run that are not common to all runs, counted after those that are."""
        return self.places(number)[~self.common] - self.common.sum()

    def values(self, number: int, shared: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return a run's coordinates from those of the cluster."""
        return np.concatenate([shared, others])[self.places(number)]

    def equations(self) -> SharedEquations:
        """The normal equations of what all runs share."""
        size = int(self.places(len(self.runs) - 1).max()) + 1
        normal, right, precision = np.zeros((size, size)), np.zeros((size, 1)), np.zeros(size)
        for number, run in enumerate(self.runs):
            places, data, counted = self.places(number), run.information, run.prior.counted
            normal[np.ix_(places, places)] += data
            # a run's solution satisfies its own equations, so that these are had from it without its samples
            right[places, 0] += (data + np.diag(counted)) @ run.z
            precision[places] = np.where(self.common, 0.0, counted)
        return eliminated(normal + np.diag(precision), right, np.arange(size) < self.common.sum())


def _scatter(reduced: Sequence[SharedEquations], z: np.ndarray) -> tuple[float, float]:
    """Root of the runs' mean squared departure from the pooled estimate in units of their noise, at least 1."""
    if len(reduced) == 1:
        return 1.0, np.inf
    squares, rank = 0.0, 0
    for equations in reduced:
        # quadratic form of the score (Cochran's Q): chi-squared with the rank as degrees of freedom
        residual = (equations.right - equations.matrix @ z)[:, 0]
        squares += float(residual @ np.linalg.pinv(equations.matrix, rcond=1e-10, hermitian=True) @ residual)
        rank += int(np.linalg.matrix_rank(equations.matrix, rtol=1e-10, hermitian=True))
    freedom = max(rank * (len(reduced) - 1) / len(reduced), 1.0)
    return max(float(np.sqrt(squares / freedom)), 1.0), freedom

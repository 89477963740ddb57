"""Errors of a rig from runs of bodies whose ten parameters are known: the runs at their best, the body a prior.

Errors that leave no trace in the data of an unknown body, such as one gain of all axes of the moment, are told by a
known one. All errors of the rig are open under their priors; offsets, drifts and the like are each run's own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.estimation.joint.joint_model import TEN, SpecificForce
from identify.estimation.joint.joint_pooling import PooledJoint, pool, shared_unknowns
from identify.estimation.joint.priors import (
    Alignment,
    ConstantError,
    Prior,
    PriorBlock,
    Setting,
    correlated,
    indices,
    run_prior,
    without,
)
from identify.estimation.joint.single_run import SolvedRun
from identify.estimation.methods.base import Problem
from identify.estimation.methods.joint import specific_force_source
from identify.exceptions import RunError
from identify.judge.judged_fits import declared_of, judged_ways, rows_in_band
from identify.judge.run_fit import fit_run
from identify.least_squares.row_products import inverse, products, solution
from identify.results.identification_result import Identification
from identify.results.ledger import student_quantile
from identify.rigid_body.inertial_parameters import PARAMETERS, InertialParameters
from identify.signals.run import Run

OF_THE_BODY = (*TEN, "cg_from_still")
"""Unknowns that each known body has by itself."""
EXACT = 1e-9
"""Standard uncertainty over its size of a parameter that is known exactly.

Numerical: it stays an unknown, so that all bodies have the same ones.
"""
DETERMINED = 0.5
"""Part of the prior's variance of a direction above which the runs do not determine it."""
FREEDOM_OF_PRIORS = 3.0
"""Degrees of freedom of the priors' sizes, which are known to some 40 % (GUM G.4.2): a large error is found whole."""
STEPS = 50
"""Steps of the search for the variances of large errors.

Numerical: they change by less than a thousandth after half as many.
"""
NORMAL = float(student_quantile(np.inf, 0.975))
WRONG_BY = 0.1
"""Standard uncertainty, over the mass or the largest moment, of a known body's parameter that may be wrong.

Prior: a drawing of another revision, a hole that was not drawn.
"""


@dataclass(frozen=True, eq=False)
class KnownBody:
    """A body whose ten parameters are known, with its runs."""

    name: str
    parameters: InertialParameters
    """Ten parameters with their covariance; NaN what is not known."""
    problem: Problem
    """Runs of the body, with all errors of the rig that are open, one :class:`ConstantError` each."""
    result: Identification
    """Identification of the body from these runs as if it were not known; searches start there."""

    @property
    def force_from(self) -> SpecificForce:
        """Source of the specific force at the centre of gravity."""
        weightless = any(map(judged_ways(self.result, self.problem).falls, self.problem.runs))
        return "none" if weightless else specific_force_source(self.problem)

    @property
    def block(self) -> PriorBlock:
        """Prior of mass, centre of gravity and tensor: as known, else as declared."""
        declared = declared_of(self.result, self.problem, self.force_from).blocks
        mean = np.concatenate([declared["mass",].mean, declared["r_cg",].mean, np.zeros(6)])
        covariance = np.zeros((10, 10))
        covariance[:1, :1], covariance[1:4, 1:4] = declared["mass",].covariance, declared["r_cg",].covariance
        stated = np.isfinite(self.parameters.values)
        mean[stated] = self.parameters.values[stated]
        covariance[np.ix_(stated, stated)] = self.parameters.covariance[np.ix_(stated, stated)]
        covariance[np.ix_(stated, ~stated)] = covariance[np.ix_(~stated, stated)] = 0.0
        size = np.repeat([mean[0], 0.1, np.abs(mean[4:]).max()], [1, 3, 6])
        # what the runs contradict moves the tensor that they show, as if the body were less well known
        misfit = self.result.ledger.of_tiers("contradicted").covariance
        return PriorBlock(mean, covariance + np.nan_to_num(misfit) + np.diag((EXACT * size) ** 2))

    @property
    def alignment(self) -> Alignment:
        """Prior of delay and rotation of the IMU, where no error of the problem is one of them."""
        return self.setting(self.problem.runs[0]).alignment

    @property
    def prior(self) -> Prior:
        """Prior of a run's unknowns, but for the gyro's noise."""
        return run_prior(self.setting(self.problem.runs[0]), np.ones(3))

    def setting(self, run: Run) -> Setting:
        """Return the priors of a run's unknowns."""
        setting = declared_of(self.result, self.problem, self.force_from)
        blocks, offsets = without(setting.blocks, TEN), ("force_offset", "moment_offset")
        if self.problem.offsets == "none":
            none = PriorBlock(np.zeros(3), np.zeros((3, 3)))
            return replace(setting, blocks=blocks | {TEN: self.block, offsets[:1]: none, offsets[1:]: none}, flat=())
        flat = offsets[1:] if self.force_from == "none" else offsets
        return replace(setting, blocks=blocks | {TEN: self.block}, flat=flat)


class Doubt(NamedTuple):
    """A parameter of a known body that, were it wrong, would explain the runs better than errors of the rig do."""

    body: str
    parameter: str
    """Name among :data:`identify.rigid_body.inertial_parameters.PARAMETERS`."""
    change: float
    """Difference of the runs' value from the known one, in SI."""
    uncertainty: float
    """Standard uncertainty of the change, in SI."""
    log_odds: float
    """Natural logarithm of the Bayes factor for it, against the errors of the rig alone."""


@dataclass(frozen=True, eq=False)
class RigErrors:
    """Posterior of a rig's errors, in axes that are independent and of one standard uncertainty before the runs."""

    axes: Mapping[str, slice]
    """Places of the axes of each error, or set of correlated errors."""
    mean: Float[np.ndarray, " k"]
    covariance: Float[np.ndarray, "k k"]
    scatter: float
    """Ratio of the scatter between runs, or bodies, to that which their noise predicts."""
    departure: float
    """Chi-squared of the errors that the runs determine, under their priors."""
    directions: int
    """Number of these errors: degrees of freedom of ``departure``."""
    under_normal: tuple[Float[np.ndarray, " k"], Float[np.ndarray, "k k"]]
    """Mean and covariance where large errors have normal priors, too."""
    doubts: tuple[Doubt, ...] = ()

    @property
    def chance(self) -> float:
        """Probability of so large a departure where priors and bodies are right."""
        return float(scipy.special.chdtrc(self.directions, self.departure)) if self.directions else 1.0

    def distance(self, numbers: Float[np.ndarray, "n k"]) -> Float[np.ndarray, " n"]:
        """Return how far the runs place some combinations of the axes from zero, in what chance scatters them by."""
        mean, covariance = self.under_normal
        variance = np.einsum("nk,kl,nl->n", numbers, np.eye(len(mean)) - covariance, numbers)
        determined = variance > (1 - DETERMINED) * np.square(numbers).sum(axis=1)
        return np.where(determined, np.abs(numbers @ mean) / np.sqrt(np.where(determined, variance, 1.0)), 0.0)


def rig_errors(bodies: Sequence[KnownBody]) -> RigErrors:
    """Return the rig's errors from the runs of one or more known bodies.

    Raises:
        RunError: a run is too short.
    """
    first, pooled = bodies[0], _pooled(bodies)
    axes, by_axis = _axes(first, pooled.shared)
    # what scatters between runs, or bodies, widens what all of them tell; few of them by Student's t
    wider = pooled.scatter**2 * float(student_quantile(pooled.degrees_of_freedom, 0.975) / NORMAL) ** 2
    root, count = first.prior.root[:, pooled.shared], by_axis.shape[1]
    of_body = np.eye(root.shape[1])[:, root[indices(OF_THE_BODY)].any(axis=0)]
    columns = np.hstack([by_axis, of_body])
    data = _Information(columns.T @ pooled.information @ columns / wider, columns.T @ pooled.right / wider)
    mean, covariance = data.posterior(np.ones(columns.shape[1]))
    under_normal = mean[:count], covariance[:count, :count]
    departure, directions = _departure(*under_normal)
    mean, covariance = data.posterior(np.append(_heavy_tailed(data, axes), np.ones(of_body.shape[1])))
    return RigErrors(
        axes=axes, mean=mean[:count], covariance=covariance[:count, :count], scatter=pooled.scatter,
        departure=departure, directions=directions, under_normal=under_normal,
        doubts=_doubts(first, data, root[indices(TEN)] @ of_body) if len(bodies) == 1 else (),
    )  # fmt: skip


def _pooled(bodies: Sequence[KnownBody]) -> PooledJoint:
    """All runs together: of several bodies each has its own ten parameters, in all of its runs."""
    several = len(bodies) > 1
    runs = [
        _fitted(body, run, str(number) if several else None)
        for number, body in enumerate(bodies) for run in body.problem.runs
    ]  # fmt: skip
    shared = shared_unknowns(bodies[0].problem.errors, calibrated=False)
    body_unknowns = {*OF_THE_BODY}
    return pool(runs, shared - body_unknowns, body_unknowns) if several else pool(runs, shared | body_unknowns)


class _Information(NamedTuple):
    """Information of all runs on axes of errors and on the body's coordinates, all standard normal before the runs."""

    matrix: np.ndarray
    right: np.ndarray

    def posterior(self, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and covariance where the priors have other variances."""
        covariance = inverse(self.matrix + np.diag(1 / variance))
        return covariance @ self.right, covariance

    def for_another(self, column: np.ndarray) -> tuple[float, float]:
        """Return what the runs tell of another unknown, which acts as a column of the others: precision and score."""
        mean, covariance = self.posterior(np.ones(len(self.right)))
        seen = self.matrix @ column
        return float(column @ seen - seen @ covariance @ seen), float(column @ self.right - seen @ mean)


def _heavy_tailed(data: _Information, axes: Mapping[str, slice]) -> np.ndarray:
    """Variance of each error's axes under Student's t in place of the normal prior: of an error that is large.

    The expected precision of the scale mixture, one factor an error, in turn with the posterior (EM).
    """
    count = max((axis.stop for axis in axes.values()), default=0)
    variance = np.ones(len(data.right))
    for _ in range(STEPS):
        mean, covariance = data.posterior(variance)
        square = mean**2 + np.diag(covariance)
        for axis in axes.values():
            freedom = FREEDOM_OF_PRIORS + axis.stop - axis.start
            variance[axis] = max((FREEDOM_OF_PRIORS + square[axis].sum()) / freedom, 1.0)
    return variance[:count]


def _departure(mean: np.ndarray, covariance: np.ndarray) -> tuple[float, int]:
    """Chi-squared of what the runs determine under its prior, and its degrees of freedom."""
    # the posterior mean is expected to scatter by the prior less the posterior covariance
    variance, directions = np.linalg.eigh(np.eye(len(mean)) - covariance)
    counted = variance > 1 - DETERMINED
    squares = (directions[:, counted].T @ mean) ** 2 / variance[counted]
    return float(squares.sum()), int(counted.sum())


def _fitted(body: KnownBody, run: Run, mounting: str | None) -> SolvedRun:
    """A run at its best, the body within its prior."""
    rows = rows_in_band(run, judged_ways(body.result, body.problem))
    if rows is None:
        raise RunError(f"{run.name} is too short for a calibration: record for longer")
    mean = body.block.mean
    fit = fit_run(run, rows, body.setting(run), {"mass": mean[:1], "r_cg": mean[1:4], "inertia": mean[4:]})
    information = fit.weights @ products(fit.columns, fit.columns)
    departure = fit.residuals + fit.columns @ fit.best
    right = fit.weights @ products(fit.columns, departure[:, :, None])[:, 0]
    information = (information + information.T) / 2
    z = solution(information + np.diag(fit.prior.counted), right)
    return SolvedRun(replace(run, mounting=mounting), fit.prior, information, z)


def _axes(body: KnownBody, shared: np.ndarray) -> tuple[dict[str, slice], np.ndarray]:
    """Places of the axes of each error, and what each adds to the shared coordinates of the prior."""
    every = dict(body.problem.errors)
    for name in ("delay", "rotation"):  # which the alignment has
        if not any(error.unknown == name for error in body.problem.errors.values()):
            sigma = np.diag(np.broadcast_to(getattr(body.alignment, f"sigma_{name}"), len(indices([name]))))
            if sigma.any():
                every[name] = ConstantError(name, np.zeros(len(sigma)), sigma**2, root=sigma)
    sets = correlated(every)
    ends = np.cumsum([0, *(members[0].axes.shape[1] for members in sets.values())]).tolist()
    axes = {name: slice(start, end) for name, start, end in zip(sets, ends, ends[1:], strict=False)}
    root = body.prior.root
    stacked = np.zeros((len(root), ends[-1]))
    for name, members in sets.items():
        for member in members:
            stacked[indices([member.unknown]), axes[name]] += member.axes
    return axes, np.linalg.pinv(root[:, shared]) @ stacked


def _doubts(body: KnownBody, data: _Information, by_body: np.ndarray) -> tuple[Doubt, ...]:
    """Parameters of the known body that the runs would rather have otherwise, the most probable first.

    Args:
        body: the known body.
        data: what its runs tell.
        by_body: change of the ten parameters by the body's coordinates, the last ones of ``data``.
    """
    size = np.repeat([body.block.mean[0], np.inf, np.abs(body.block.mean[4:]).max()], [1, 3, 6])
    first, doubts = len(data.right) - by_body.shape[1], []
    back = np.linalg.pinv(by_body)
    for k in np.flatnonzero(np.isfinite(size)):
        wrong = WRONG_BY * size[k]
        column = np.concatenate([np.zeros(first), wrong * back[:, k]])
        precision, score = data.for_another(column)
        if precision > 1:  # else the runs do not tell it
            odds = 0.5 * score**2 / (precision + 1) - 0.5 * np.log(precision + 1)
            change, u = wrong * score / precision, wrong / np.sqrt(precision)
            doubts.append(Doubt(body.name, PARAMETERS[k], float(change), float(u), float(odds)))
    return tuple(sorted(doubts, key=lambda doubt: -doubt.log_odds))

"""Every estimator's result, judged by force and moment of its runs: causes are named, intervals widened.

In free flight nothing tells the attitude, and no cause can be judged.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.errors.error_model import ErrorModel
from identify.errors.imu.accelerometer_delay import ACCELEROMETER_DELAY
from identify.errors.imu.gyro_axes import GYRO_AXES
from identify.errors.registry import ERRORS
from identify.errors.rig.weight import WEIGHT
from identify.errors.written_sizes import ROUNDING
from identify.estimation.joint.error_columns import ErrorColumns
from identify.estimation.joint.joint_pooling import shared_unknowns
from identify.estimation.methods.base import Problem
from identify.judge import held_errors
from identify.judge.causes import FollowedCause, Judgement, followed
from identify.judge.evidence import NullModel
from identify.judge.findings import MATTERS
from identify.judge.held_errors import by_held_errors
from identify.judge.judged_fits import fit_of_estimator, fits_of, judged_ways
from identify.judge.judged_part import judged_part
from identify.judge.rivals import JudgedWay, effect, rivals_text
from identify.judge.run_findings.least_squares import DIFFERENT, least_squares_cause, least_squares_difference
from identify.judge.run_findings.resonance import lines_of, resonance
from identify.judge.run_findings.saturation import saturated
from identify.judge.run_findings.unexplained import EXPLAINS, IMITATED, UNEXPLAINED, FollowsNoCause, InBandResidual
from identify.judge.run_fit import RunFit, base_of, tensor_change
from identify.least_squares.covariance_matrices import root_of
from identify.results.declaration import Declaration, ResidualCause
from identify.results.identification_result import MISFIT, Identification
from identify.results.ledger import Row, tensor_row
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.signals.run import Run

WIDENS = 0.2
"""Part of the residuals that a cause explains from which it is worth a warning, too: the interval is wider for it.

Price: an interval 12 % wider than without the cause, ``1 / sqrt(1 - 0.2)``.
"""
LISTED = 4
"""Most runs that a finding names.

Choice: what fits a line; ``result.json`` has all.
"""
PLACES = ("r_cg", "cg_from_still")
"""Unknowns that tell where the centre of gravity is."""


class Judged(NamedTuple):
    """Findings of the runs' force and moment against a result, and the errors that they show."""

    rows: tuple[Row, ...] = ()
    """Errors that the runs show, and declared turns of the gyro that the joint model lacks."""
    causes: tuple[ResidualCause, ...] = ()
    declarations: tuple[Declaration, ...] = ()
    """Declared quantities that the runs place elsewhere, the farthest record of each."""
    warnings: tuple[str, ...] = ()
    """All warnings: the result's, without those that a cause explains, and the judge's."""
    by_held_errors: Mapping[str, np.ndarray] | None = None
    """Derivatives of the ten parameters by errors of the rig that count as zero; None: not computed."""


def judged(result: Identification, problem: Problem) -> Judged:
    """Return what force and moment of its runs say against a result.

    A cause that shifts a component by half its standard uncertainty or more is a warning; the shift counts as a
    standard uncertainty, too (``model misfit``).

    Args:
        result: of an estimator.
        problem: that it was given.
    """
    if result.seen is not None:
        return Judged(declarations=held_errors.farthest(result.declarations), warnings=result.warnings)
    declarations, explained = list(result.declarations), list[str]()
    signals = _by_signals(problem)  # a sensor's range may end anywhere
    problem = replace(problem, runs=tuple(judged_part(run, problem.band) for run in problem.runs))
    excluded = _excluded(problem, result)
    names = frozenset(error.name for error in excluded)
    fits = problem.by_run(partial(fits_of, ways=judged_ways(result, problem), excluded=names))
    joined = examined(fits, result, problem, excluded)
    if joined is None:
        contributions, errors = merged(signals, len(fits)), list[FollowedCause]()
    else:
        contributions, errors = joined.contributions(signals), joined.errors_of_force
    causes = tuple(contribution.finding for contribution in contributions)
    candidates = [fit_of_estimator(*pair, result, problem) for pair in zip(problem.runs, fits, strict=True)]
    estimator_fits = [fit for fit in candidates if fit]
    held = by_held_errors(result, problem, estimator_fits) if len(estimator_fits) == len(problem.runs) else None
    departing = held_errors.departing_declarations(problem, estimator_fits, errors)
    if result.method != "joint":
        declarations += departing
    elif errors:  # an exact quantity that is off has moved the other of the two in the joint estimate
        open_to = {"mass", "r_cg"} - {record.quantity for record in departing}
        explained = [record.text for record in declarations if record.quantity in open_to]
        declarations = [record for record in declarations if record.quantity not in open_to]
    exact = held_errors.exact_quantities(problem)
    blamed = (cause for cause in errors if cause.candidate.error in exact)
    declarations += (held_errors.exact_declaration(cause, problem) for cause in blamed)
    texts = [record.text for record in declarations if record not in result.declarations and not record.exact]
    unexplained = [text for text in result.warnings if text not in explained]
    # least squares count declared turns of the gyro by their source, the joint model has them as the whole IMU's
    turns = (
        gyro_turns(held["rotation"], _declared_turns(problem)) if result.method == "joint" and held is not None else []
    )
    changes = np.hstack([np.zeros((6, 0)), *(contribution.changes for contribution in contributions)])
    misfit = tensor_row(MISFIT, changes * result.determined[:, None], tier="contradicted")
    return Judged(
        rows=tuple(row for row in (*turns, misfit) if row.changes.any()), causes=causes,
        declarations=held_errors.farthest(declarations),
        warnings=(*unexplained, *texts, *(cause.text for cause in causes)), by_held_errors=held,
    )  # fmt: skip


def _declared_turns(problem: Problem) -> dict[str, np.ndarray]:
    """One standard uncertainty of each declared turn of the gyro about each axis [rad], in columns, by its source."""
    return {
        name: error.axes
        for name, error in problem.errors.items()
        if error.unknown == "rotation" and not error.correlated_as
    }


def gyro_turns(by_turn: Float[np.ndarray, "10 3"], turns: Mapping[str, Float[np.ndarray, "3 q"]]) -> list[Row]:
    """Return the rows of declared turns of the gyro, which the joint model has as turns of the whole IMU.

    Args:
        by_turn: derivative of the ten parameters by a turn of the gyro against the accelerometer.
        turns: one standard uncertainty of each axis [rad], in columns, by source.
    """
    return [Row(error=name, changes=by_turn @ axes) for name, axes in turns.items()]


class Contribution(NamedTuple):
    """A finding, and what it adds to the tensor's uncertainty."""

    finding: ResidualCause
    changes: Float[np.ndarray, "6 k"] = np.zeros((6, 0))
    """Changes of the tensor by one standard uncertainty of each of k independent errors [kg·m²]."""


SIGNAL_CHECKS: tuple[Callable[[Run], list[ResidualCause]], ...] = (saturated,)
"""Checks of a run's signals alone, beside which its least squares are not compared."""


def _by_signals(problem: Problem) -> list[Contribution]:
    return [Contribution(finding) for check in SIGNAL_CHECKS for run in problem.runs for finding in check(run)]


@dataclass(frozen=True, eq=False)
class JudgedRuns:
    """Runs at their best together, with what their residuals follow."""

    result: Identification
    problem: Problem
    runs: Sequence[Run]
    """The runs that are long enough."""
    weights: Sequence[float]
    """Weight of each run in the pooled tensor."""
    fits: Sequence[RunFit]
    """Fit of each run, by the first way to have its specific force."""
    last: JudgedWay
    """The last way."""
    named: Mapping[ErrorModel, Sequence[FollowedCause]]
    """Causes by finding, where each shows most first."""
    ways: Mapping[ErrorModel, JudgedWay]
    """Last way whose judgement names each cause."""
    judgement: Judgement
    """Judgement by the way that leaves the least unexplained."""

    @property
    def count(self) -> int:
        """Number of runs in the pooled tensor."""
        return len(self.problem.runs)

    @cached_property
    def u(self) -> Float[np.ndarray, "6"]:
        """Standard uncertainty of the tensor without the judge's findings [kg·m²]; 0 where it is not determined."""
        u = self.result.standard_uncertainty
        return np.where(np.isfinite(u), u, 0.0)

    @cached_property
    def exact(self) -> dict[ErrorModel, str]:
        """Quantities that count as exact, by the finding that blames them."""
        return held_errors.exact_quantities(self.problem)

    @property
    def errors_of_force(self) -> list[FollowedCause]:
        """Errors of exact quantities, or of the weight, that have no rival."""
        blamed = {*self.exact, WEIGHT}
        return [causes[0] for finding, causes in self.named.items() if finding in blamed and not causes[0].rivals]

    def contributions(self, signals: Sequence[Contribution]) -> list[Contribution]:
        """Return all findings, the most important first, with those of the runs' signals alone."""
        causes = [part for finding, causes in self.named.items() for part in self._of_cause(finding, causes)]
        silent = {part.finding.run for part in signals}
        of_runs = [part for k in range(len(self.runs)) for part in self._of_run(k, silent)]
        rest = unexplained_once([*merged([*signals, *of_runs], self.count), *self._of_implausible()])
        # causes that explain little imitate what is not looked for, which then comes first
        first, others = _split(rest) if self._imitated else ([], rest)
        return [*first, *causes, *others]

    @property
    def _imitated(self) -> bool:
        return bool(self.named) and min(self.judgement.explained) <= EXPLAINS

    def effects(self, cause: FollowedCause) -> Float[np.ndarray, "10 p"]:
        """Return the changes of the ten parameters by a typical size of each coefficient of a cause."""
        if self.result.method == "joint":
            return cause.evidence.effects
        by_tensor = tensor_change(self.fits, self.weights, cause.columns(self.fits))
        return np.vstack([np.zeros((4, by_tensor.shape[1])), by_tensor])

    def largest(self, changes: Float[np.ndarray, "6"]) -> tuple[int, float]:
        """Return the component that changes most for its standard uncertainty, and by how many of these."""
        ratio = np.abs(changes) / self.u.clip(1e-300)
        return int(np.argmax(ratio)), float(ratio.max())

    def _of_cause(self, finding: ErrorModel, causes: Sequence[FollowedCause]) -> list[Contribution]:
        """A cause in all its runs; none where it neither moves the tensor nor explains much."""
        pairs = [(self.effects(cause), cause.evidence) for cause in causes]
        changes = np.sum([by @ evidence.coefficients for by, evidence in pairs], axis=0)
        if finding in self.exact:  # which the result keeps, though it errs
            changes[{"mass": slice(0, 1), "r_cg": slice(1, 4)}[self.exact[finding]]] = causes[0].evidence.values
        _, moved = self.largest(changes[4:])
        small = moved < MATTERS and causes[0].evidence.share < WIDENS
        if small and max(self.judgement.unexplained) < UNEXPLAINED and finding not in self.exact:
            return []
        leading, names = causes[0].evidence, [run.name for run in self.runs]
        where = [names[cause.candidate.run] for cause in causes if cause.candidate.run is not None] or names
        others = rivals_text(self.result, self.weights, self.ways[finding], leading)
        moves = f"; {effect(changes[4:], self.u)}" if moved > ROUNDING or others else ""
        sentence = causes[0].sentence(self.fits[0].prediction.quantity)
        departs = bool(self.result.declarations)  # of which a delay of the accelerometer is the cause, and then no note
        verdict = causes[0].verdict(
            ", ".join(where), axis=f"b{1 + int(np.argmax((leading.explained**2).sum(axis=0)[-3:]))}",
            changes=() if departs and finding is ACCELEROMETER_DELAY else tuple(changes.tolist()),
            text=f"{named_runs(where, self.count)}: {sentence}{moves}{others}",
        )  # fmt: skip
        uncertain = [by[4:] @ root_of(evidence.covariance) for by, evidence in pairs]
        return [Contribution(verdict, np.hstack([changes[4:, None], *uncertain]))]

    def _of_run(self, k: int, silent: set[str]) -> list[Contribution]:
        """Findings in one run beside the causes."""
        run, judgement, contributions = self.runs[k], self.judgement, list[Contribution]()
        fits, base = self.last
        if not self.named and run.name not in silent:
            no_news = MATTERS * self.count * self.u  # a run's part in the pooled tensor
            apart = least_squares_difference(fits[k], base.single_runs[k], no_news)
            if apart.chance < DIFFERENT:
                contributions.append(
                    Contribution(least_squares_cause(apart, run.name), apart.value[:, None] / self.count)
                )
        imitated = bool(self.named) and judgement.explained[k] <= EXPLAINS
        left_over = judgement.unexplained[k]
        if left_over > (IMITATED if imitated else UNEXPLAINED):
            verdict = InBandResidual.in_row(run.name, left_over, judgement.rows[k])
            contributions.append(Contribution(verdict, np.diag(left_over * self.u / np.sqrt(self.count))))
        lines = [] if self.result.method == "joint" else lines_of(run, self.result)
        peak, changes = resonance(run, self.problem.band), np.zeros((6, 0))
        if peak is not None:
            motion = self.fits[k].prediction.signals
            by_mounting = peak.added_to_tensor(motion.omega, motion.alpha, self.result.inertia)
            lines = lines or [peak.verdict(run, by_mounting)]
            changes = np.diag(by_mounting / np.sqrt(self.count))
        return contributions + [Contribution(line, changes if line is lines[0] else np.zeros((6, 0))) for line in lines]

    def _of_implausible(self) -> list[Contribution]:
        """A finding on residuals that follow the motion in all runs, by no known cause; not divided by their number."""
        cause = self.judgement.implausible
        if cause is None:
            return []
        changes = self.effects(cause)[4:] @ cause.evidence.coefficients
        worst, moved = self.largest(changes)
        if moved < MATTERS:
            return []
        names = [run.name for run in self.runs]
        where = names if cause.candidate.run is None else [names[cause.candidate.run]]
        axis = f"b{1 + int(np.argmax((cause.evidence.explained**2).sum(axis=0)[-3:]))}"
        follows = FollowsNoCause(
            topic=named_runs(where, self.count), most_like=cause.candidate.error.label,
            component=COMPONENTS[worst], shift=GRAM_METRE * float(changes[worst]),
        )  # fmt: skip
        verdict = follows.verdict(axis=axis, share=cause.evidence.share)
        return [Contribution(verdict._replace(run=", ".join(where)), changes[:, None])]


def examined(
    fits: Sequence[list[RunFit]], result: Identification, problem: Problem, excluded: frozenset[ErrorModel]
) -> JudgedRuns | None:
    """Return what the residuals of all runs follow together; None: no run is long enough."""
    numbers = [number for number, ways in enumerate(fits) if ways]
    if not numbers:
        return None
    runs = [problem.runs[number] for number in numbers]
    by_way = [{fit.prediction.force_from: fit for fit in reversed(fits[number])} for number in numbers]
    common = [way for way in by_way[0] if all(way in ways for ways in by_way)]
    together = [[ways[way] for ways in by_way] for way in reversed(common)] or [[fits[number][0] for number in numbers]]
    ways = [JudgedWay(way, _base(way, result, problem)) for way in together]
    judgements = [followed(way.fits, excluded, way.base) for way in ways]
    return JudgedRuns(
        result=result, problem=problem, runs=runs, weights=[result.runs[number].weight for number in numbers],
        fits=[fits[number][0] for number in numbers], last=ways[-1],
        named=_named_once(judgements, result),
        ways={
            cause.candidate.error: way
            for way, judgement in zip(ways, judgements, strict=True) for cause in judgement.causes
        },
        judgement=min(judgements, key=lambda judgement: max(judgement.unexplained)),
    )  # fmt: skip


def _base(fits: Sequence[RunFit], result: Identification, problem: Problem) -> NullModel:
    """The model of all runs without a cause, with the declared errors."""
    # each mounting has its own centre of gravity, and so its own distance from a point at rest
    drawn = PLACES if len({run.mounting for run in problem.runs}) > 1 else ()
    # the joint estimate alone takes the load cell's zero from static poses; others fit one in each run
    calibrated = problem.centre is not None and result.method == "joint"
    shared = shared_unknowns(problem.errors, calibrated=calibrated, drawn_by_mounting=drawn)
    base = base_of(fits, shared)
    axes = np.hstack([np.zeros((3, 0)), *_declared_turns(problem).values()])
    if not axes.size:
        return base
    # the fit has a declared turn of the gyro as one of the whole IMU
    return base.extended([fit.transformed(ErrorColumns(fit.prediction).columns(GYRO_AXES) @ axes) for fit in fits])


def _excluded(problem: Problem, result: Identification) -> frozenset[ErrorModel]:
    """Causes that the experiment excludes, or whose prior is so wide that they are no finding."""
    free = _undeclared(problem, result)
    missing = {"mounting"} if all(map(judged_ways(result, problem).falls, problem.runs)) else set()
    if problem.offsets == "none":
        missing.add("zero")
    return frozenset(
        error for error in ERRORS.values() if error.needs & missing or (error.by_hand and free & set(error.unknowns))
    )


def named_runs(names: Sequence[str], count: int) -> str:
    """Return the runs of a finding in words, of so many."""
    if len(names) == count:
        return names[0] if count == 1 else f"all {count} runs"
    listed = ", ".join(names[:LISTED]) + ", …" * (len(names) > LISTED)
    return listed if len(names) == 1 else f"{len(names)} of {count} runs ({listed})"


def merged(contributions: Sequence[Contribution], count: int) -> list[Contribution]:
    """Return findings on single runs with one line for each, in the words of the run where it shows most.

    Args:
        contributions: whose text begins with their run.
        count: of all runs.
    """
    groups: dict[tuple[str, str], list[Contribution]] = {}
    for part in contributions:
        axis = part.finding.axis * (part.finding.cause != InBandResidual.label)
        groups.setdefault((part.finding.cause, axis), []).append(part)
    lines = []
    for group in groups.values():
        largest = max(group, key=lambda part: part.finding.share).finding
        names = list(dict.fromkeys(part.finding.run for part in group))
        words = largest.text.removeprefix(f"{largest.run}: ")
        text = f"{named_runs(names, count)}: {words}{f' (as in {largest.run})' if len(names) > 1 else ''}"
        changes = np.hstack([part.changes for part in group])
        lines.append(Contribution(largest._replace(run=", ".join(names), text=text), changes))
    return lines


def _split(contributions: Sequence[Contribution]) -> tuple[list[Contribution], list[Contribution]]:
    """Findings that no cause explains, and the others."""
    unexplained = [part.finding.cause == InBandResidual.label for part in contributions]
    pairs = list(zip(contributions, unexplained, strict=True))
    return [part for part, is_it in pairs if is_it], [part for part, is_it in pairs if not is_it]


def unexplained_once(contributions: Sequence[Contribution]) -> list[Contribution]:
    """Return findings with one line on what no cause explains, the first, and what all of it costs."""
    unexplained, others = _split(contributions)
    if not unexplained:
        return others
    return [Contribution(unexplained[0].finding, np.hstack([part.changes for part in unexplained])), *others]


def _named_once(judgements: Sequence[Judgement], result: Identification) -> dict[ErrorModel, list[FollowedCause]]:
    """Causes of the first judgement that names any which can err in the result; the run where each shows most first."""
    others = {error for error in ERRORS.values() if error.part == "accelerometer" and result.method != "joint"}
    if any(cause.candidate.error is WEIGHT for cause in judgements[-1].causes):
        judgements = judgements[-1:]  # the accelerometer tells it from the mass, a point at rest does not
    for judgement in judgements:
        named: dict[ErrorModel, list[FollowedCause]] = {}
        for cause in judgement.causes:
            if cause.candidate.error not in others:
                named.setdefault(cause.candidate.error, []).append(cause)
        if named:
            return named
    return {}


def _undeclared(problem: Problem, result: Identification) -> frozenset[str]:
    """Unknowns whose prior is so wide that an error of them is no finding."""
    free = {"mass"} if problem.mass is None and problem.centre is None else set()
    if problem.cg_motion != "still":
        free.add("cg_from_still")
    return frozenset(free | ({"delay", "rotation"} if result.method == "joint" else set()))

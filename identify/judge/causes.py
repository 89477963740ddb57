"""The errors that are looked for in the residuals of runs, and those that these follow."""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.errors.error_model import ErrorModel
from identify.errors.registry import ERRORS
from identify.estimation.joint.error_columns import ErrorColumns
from identify.judge.evidence import Evidence, NullModel, evidence
from identify.judge.run_fit import RunFit, UnitLines
from identify.results.declaration import ResidualCause

CHANCE = 1e-4
"""Chance that residuals follow one cause by accident, above which nothing is reported.

Chance: as computed, some 27 causes together reach it in one clean run of 400. ``LIKELY`` is stricter: 40 clean runs
reach 6e-6 (``tests.helpers.judge_margins``).
"""
LIKELY = 3.0
"""Logarithm of the Bayes factor from which a cause is more probable than none, or than another.

Definition: odds of twenty to one, strong evidence by Kass and Raftery (doi:10.1080/01621459.1995.10476572). In 40 clean
runs at most 1.1, in the middle −1.7 (``tests.helpers.judge_margins``).
"""
UNLIKE = 1e-3
"""Chance that a run departs from the value that all runs share, over all runs, below which they do not share one.

Chance: one false alarm in a thousand causes that are there.
"""
IMPOSSIBLE = 1e-5
"""Probability under its prior of a cause as large as it seems, below which it is not that cause.

Prior: some 300 typical sizes: gains that are off by the whole, a gyro turned by a radian.
"""
FREE = 100.0
"""Factor on a named cause's prior size when the rest is judged, so that the prior holds nothing back.

Choice: any at which the prior hardly counts; what it holds back would count as unexplained.
"""
MOST = 3
"""Causes that are named of one run.

Choice: what a reader checks at once.
"""
NEARLY = 0.85
"""Part of what a cause explains that a cause of fewer coefficients must explain to be named in its place.

Choice: many coefficients imitate a few.
"""
ECHO = 0.3
"""Least share, of what the first cause explains, that a further cause must explain.

Choice: less may be an error of linearisation of the first.
"""


class PossibleCause(NamedTuple):
    """A cause in the runs that would have it."""

    error: ErrorModel
    run: int | None
    """Index of the run to which it belongs; None: it belongs to the rig, and all runs have it."""
    size: Float[np.ndarray, " p"]
    """Typical size of each coefficient, in SI."""
    acting: Bool[np.ndarray, " numbers"]
    """Mask of the error's numbers that are coefficients: those that do anything."""
    lines: list[np.ndarray]
    """Lines of the cause in each run that has it, for coefficients in typical sizes, (m, rows, p)."""

    def judged(self, base: NullModel, *, white: bool = False, below: float = np.inf) -> Evidence | None:
        """Return what the residuals say of it.

        Args:
            base: the fitted unknowns.
            white: whether all lines are in units of their noise.
            below: chance from which on there is nothing to say; that of a run's cause, which has as many chances as
                there are runs, is smaller.
        """
        if self.run is None:
            return evidence(base, self.error, self.size, self.lines, white=white, below=below)
        run_base, below = base.single_runs[self.run], below / len(base.runs)
        verdict = evidence(run_base, self.error, self.size, self.lines, white=white, below=below)
        return None if verdict is None else verdict._replace(lines=self.in_every_run(base))

    def in_every_run(self, base: NullModel) -> list[np.ndarray]:
        """Return its lines in each run, zeros where a run has none."""
        if self.run is None:
            return self.lines
        (own,) = self.lines
        return [
            own if k == self.run else np.zeros((*run.departure.shape, own.shape[2])) for k, run in enumerate(base.runs)
        ]

    def weighted(self, noise: Sequence[np.ndarray]) -> "PossibleCause":
        """Return it with each line in units of its noise, whose standard deviation is given."""
        having = noise if self.run is None else [noise[self.run]]
        return self._replace(lines=[part / deviation for part, deviation in zip(self.lines, having, strict=True)])

    def agrees(self, base: NullModel, verdict: Evidence) -> bool:
        """Return whether the runs agree on its value."""
        if self.run is not None or len(base.runs) == 1:
            return True
        common = base.extended(verdict.lines, verdict.scale)
        further = [evidence(common.single_runs[k], self.error, self.size, [part]) for k, part in enumerate(self.lines)]
        return min([more.chance for more in further if more is not None], default=1.0) * len(further) > UNLIKE


def candidates(fits: Sequence[RunFit], excluded: frozenset[ErrorModel]) -> list[PossibleCause]:
    """Return the causes to look for.

    Args:
        fits: of the runs, at their best.
        excluded: causes that cannot be, or that are no news.
    """
    made: list[PossibleCause] = []
    for error in ERRORS.values():
        if error.prior is not None and error not in excluded:
            parts = [fit.errors[error.name] for fit in fits]
            owners: Iterable[int | None] = range(len(fits)) if error.scope == "run" else [None]
            made += [_candidate(error, owner, parts) for owner in owners]
    return [candidate for candidate in made if len(candidate.size)]


def unit_lines(fit: RunFit, excluded: Collection[str]) -> dict[str, UnitLines]:
    """Return what the errors that are looked for make in a run, by their names, but for those of some names."""
    run, made = ErrorColumns(fit.prediction), dict[str, UnitLines]()
    for name, error in ERRORS.items():
        if error.prior is not None and name not in excluded:
            columns = run.columns(error)
            size, acting = error.prior(run.rows, columns), np.asarray(columns.any(axis=(0, 1)))
            made[name] = UnitLines(fit.transformed(columns), size, acting)
    return made


def _candidate(error: ErrorModel, run: int | None, parts: Sequence[UnitLines]) -> PossibleCause:
    """A cause without the coefficients that do nothing; of the rig's, with the mean of the runs' typical sizes."""
    having = parts if run is None else [parts[run]]
    size = np.mean([part.size for part in having], axis=0)
    acting = np.any([part.acting for part in having], axis=0) & (size > 0)
    return PossibleCause(error, run, size[acting], acting, [part.lines[:, :, acting] * size[acting] for part in having])


class FollowedCause(NamedTuple):
    """A cause that the residuals follow."""

    candidate: PossibleCause
    evidence: Evidence
    rivals: tuple[str, ...] = ()
    """Other causes that are about as probable."""

    def columns(self, fits: Sequence[RunFit]) -> list[np.ndarray]:
        """Return the change of the measured wrench of each run by a typical size of each coefficient.

        Args:
            fits: of all runs, in which the cause was looked for.

        Returns:
            (n, 6, p) of each run [N], [N·m].
        """
        error, run, size, acting, _ = self.candidate
        return [
            ErrorColumns(fit.prediction).columns(error)[:, :, acting] * size * (run in (None, k))
            for k, fit in enumerate(fits)
        ]

    def verdict(self, run: str, *, axis: str, text: str, changes: tuple[float, ...]) -> ResidualCause:
        """Return the cause as a finding on a run, in these words, with what it would add to the ten parameters."""
        error = self.candidate.error
        return ResidualCause(
            cause=error.label, axis=axis, share=self.evidence.share, text=text, run=run, changes=changes,
            docs=error.words.docs,
        )  # fmt: skip

    def sentence(self, quantity: str) -> str:
        """Return what the residuals follow, and the cure.

        Args:
            quantity: words for what was measured: force and moment, or the moment alone.
        """
        words = self.candidate.error.words
        also = f"; as probable: {', '.join(self.rivals)}" if self.rivals else ""
        verb = "looks" if quantity == "the moment" else "look"
        return f"{quantity} {verb} {words.phrase(self.evidence.values, self.evidence.spread)}{also}; {words.cure}"


class Judgement(NamedTuple):
    """Causes that explain the residuals of the runs, and what none explains."""

    causes: list[FollowedCause]
    """Causes that the residuals follow, the most probable first."""
    implausible: FollowedCause | None
    """The most probable of the causes on which the runs disagree, or whose size cannot be; None: there is none."""
    explained: list[float]
    """Part of each run's residuals' squares that these explain together."""
    unexplained: list[float]
    """Root mean square of what no cause explains, in the motion's band over that above it, on the worst row, by run."""
    rows: list[int]
    """Row of each run in which ``unexplained`` is largest, counted from the last: force from −6, moment from −3."""


def _simplest(likely: Sequence[FollowedCause]) -> FollowedCause:
    """The most probable cause, or a simpler one that explains nearly as much: many coefficients imitate a few.

    A simpler variant of the same finding gives way: what it leaves would count as unexplained.
    """
    best = likely[0].evidence
    simpler = [
        cause for cause in likely
        if len(cause.evidence.size) < len(best.size) and cause.evidence.share > NEARLY * best.share
    ]  # fmt: skip
    variant = bool(simpler) and simpler[0].candidate.error.label == likely[0].candidate.error.label
    return simpler[0] if simpler and not variant else likely[0]


def _shown(base: NullModel, open_to: Sequence[PossibleCause]) -> list[FollowedCause]:
    """The causes that the residuals show, the most probable first.

    Each is looked for in the noise that it would leave. Those that show are compared in one noise, the least: else a
    cause that follows the noise would make itself more probable.
    """
    verdicts = [(cause, cause.judged(base, below=CHANCE)) for cause in open_to]
    judged = [FollowedCause(cause, verdict) for cause, verdict in verdicts if verdict is not None]

    def shown(cause: FollowedCause) -> bool:
        tries = 1 if cause.candidate.run is None else len(base.runs)  # a run's cause has as many chances
        return bool(cause.evidence.logarithm - np.log(tries) > LIKELY)

    causes = list(filter(shown, judged))
    # Bayes factors compare only in one noise: that which the cause of most power leaves
    if len(causes) > 1:
        most = max(causes, key=lambda cause: cause.evidence.power).evidence
        noise = base.extended(most.lines, most.scale).noise
        weighted = base.weighted(noise)
        again = [cause.candidate.weighted(noise).judged(weighted, white=True) for cause in causes]
        causes = [
            cause._replace(evidence=cause.evidence.with_odds(verdict))
            for cause, verdict in zip(causes, again, strict=True) if verdict is not None
        ]  # fmt: skip
    return sorted(causes, key=lambda cause: -cause.evidence.logarithm)


def _as_probable(cause: FollowedCause, best: FollowedCause) -> bool:
    """Whether a cause is a rival of the best: as likely, or worse by its prior alone."""
    rival, first = cause.evidence, best.evidence
    by_prior_alone = len(rival.size) <= len(first.size) and rival.share >= first.share
    return by_prior_alone or abs(first.logarithm - rival.logarithm) < LIKELY


def followed(fits: Sequence[RunFit], excluded: frozenset[ErrorModel], base: NullModel) -> Judgement:
    """Return the causes that explain the residuals of all runs, and how far the rest of each exceeds its noise.

    Args:
        fits: of the runs, each at its best.
        excluded: causes that cannot be, or that are no news.
        base: the fitted unknowns of all runs, and what else is declared.
    """
    # forward selection: one cause at a time, the most probable, with which the rest is then judged anew
    open_to, started, free = candidates(fits, excluded), base, base
    named: list[FollowedCause] = []
    implausible, first = None, 0.0
    while len(named) < MOST + len(fits) - 1:
        shown = _shown(base, open_to)
        likely = [
            cause for cause in shown
            if cause.evidence.predicted > IMPOSSIBLE and cause.candidate.agrees(base, cause.evidence)
        ]  # fmt: skip
        others = [cause for cause in shown if cause not in likely]
        # what the runs disagree on, or what cannot be, is said to be unexplained rather than given a likely name
        if others and (not likely or others[0].evidence.logarithm > likely[0].evidence.logarithm + LIKELY):
            implausible = others[0]
            break
        if not likely:
            break
        best = _simplest(likely)
        # an echo: what a linearised first cause leaves over imitates others, but is small beside it
        power = float(
            np.square(base.stacked(base.project_out(best.evidence.lines).remaining) @ best.evidence.coefficients).sum()
        )
        if named and power < ECHO * first:
            break
        first = first or power
        rivals = dict.fromkeys(
            cause.candidate.error.label for cause in shown
            if cause.candidate.error.label != best.candidate.error.label and _as_probable(cause, best)
        )  # fmt: skip
        named.append(best._replace(rivals=tuple(rivals)))
        # under its prior it is beside further causes; freed of it, what remains is counted as unexplained
        base = base.extended(best.evidence.lines, best.evidence.scale)
        free = free.extended(best.evidence.lines, FREE * best.evidence.scale)
        taken = best.candidate.error, best.candidate.run
        open_to = [cause for cause in open_to if (cause.error, cause.run) != taken]
    rest = [_unexplained(fit, residuals) for fit, residuals in zip(fits, free.residuals, strict=True)]
    squares = [[float((rows**2).sum()) for rows in fitted.residuals] for fitted in (base, started)]
    return Judgement(
        named, implausible, explained=[1 - after / max(before, 1e-300) for after, before in zip(*squares, strict=True)],
        unexplained=[ratio for ratio, _ in rest], rows=[row for _, row in rest],
    )  # fmt: skip


def _unexplained(fit: RunFit, residuals: Float[np.ndarray, "m rows"]) -> tuple[float, int]:
    """Root mean square of residuals in the motion's band over that above it, on the worst row, and that row."""
    ratio = np.sqrt(np.mean(residuals**2, axis=0) / np.maximum(fit.above, 1e-300))
    return float(ratio.max()), int(np.argmax(ratio)) - len(ratio)

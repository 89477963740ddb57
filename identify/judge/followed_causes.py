"""The check of a run against the joint model: what its residuals follow, and what that does to the tensor."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.joint.joint_model import TEN
from identify.joint.priors import indices
from identify.judge.causes import causes
from identify.judge.evidence import Base, Evidence, evidence
from identify.judge.run_fit import RunFit

CHANCE = 1e-4
"""Chance that residuals follow one cause by accident, above which nothing is reported.

Chance: as computed, some 24 causes together reach it in one clean run of 400. ``LIKELY`` is stricter: 40 clean runs
reach 6e-6 (``tests.helpers.judge_margins``).
"""
LIKELY = 0.0
"""Logarithm of the Bayes factor from which a cause is more probable than none.

Definition: even odds. In 40 clean runs at most −0.2, in the middle −4.4 (``tests.helpers.judge_margins``).
"""
CLEAR = 3.0
"""Logarithm of the Bayes factor from which a cause is more probable than another.

Definition: odds of twenty to one, strong evidence by Kass and Raftery (doi:10.1080/01621459.1995.10476572).
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


class FollowedCause(NamedTuple):
    """A cause that a run's residuals follow."""

    evidence: Evidence
    rivals: tuple[str, ...]
    """Other causes that are about as probable."""
    changes: np.ndarray
    """Errors that the cause makes in the joint model's mass, r_CG and packed tensor [kg], [m], [kg·m²]."""

    def sentence(self, quantity: str) -> str:
        """Return what the residuals follow, and the cure.

        Args:
            quantity: words for what was measured: force and moment, or the moment alone.
        """
        finding, size = self.evidence.cause.finding, self.evidence.cause.size
        spread = size * np.sqrt(np.maximum(np.diag(self.evidence.covariance), 0.0))
        also = f"; as probable: {', '.join(self.rivals)}" if self.rivals else ""
        verb = "looks" if quantity == "the moment" else "look"
        return f"{quantity} {verb} {finding.phrase(size * self.evidence.coefficients, spread)}{also}; {finding.cure}"


class Judgement(NamedTuple):
    """Causes that a run's residuals follow, and the rest that none explains."""

    causes: list[FollowedCause]
    """Causes that the residuals follow, the most probable first."""
    explained: float
    """Part of the residuals' squares that these explain together."""
    unexplained: float
    """Root mean square of what no cause explains, in the motion's band over that above it, on the worst row."""
    row: int
    """Row in which ``unexplained`` is largest, counted from the last: force from −6, moment from −3."""


def _simplest(likely: Sequence[Evidence]) -> Evidence:
    """The most probable cause, or a simpler one that explains nearly as much: many coefficients imitate a few."""
    best = likely[0]
    simpler = [e for e in likely if len(e.coefficients) < len(best.coefficients) and e.share > NEARLY * best.share]
    return simpler[0] if simpler else best


def followed(run: RunFit, free: frozenset[str], base: Base) -> Judgement:
    """Return the causes that a run's residuals follow, and how much more than noise they leave.

    Args:
        run: at its best.
        free: unknowns of which nothing is declared.
        base: the fitted unknowns, and what else is declared.
    """
    ten = run.prior.root[indices(TEN)]
    open_to = [(cause, run.transformed(cause.columns * cause.size)) for cause in causes(run.prediction, free=free)]
    named: list[FollowedCause] = []
    first = 0.0
    while len(named) < MOST:
        judged = [e for candidate in open_to if (e := evidence(base, *candidate)) is not None]
        likely = sorted((e for e in judged if e.chance < CHANCE and e.logarithm > LIKELY), key=lambda e: -e.logarithm)
        if not likely:
            break
        best = _simplest(likely)
        power = float(np.square(base.beside(best.columns)[0] @ best.coefficients).sum())
        if named and power < ECHO * first:
            break
        first = first or power
        rivals = tuple(
            e.cause.finding.label for e in likely if e is not best and abs(best.logarithm - e.logarithm) < CLEAR
        )
        named.append(FollowedCause(best, rivals, ten @ best.shift[: len(run.z)]))
        base = base.taking(best.columns, best.coefficients)
        open_to = [candidate for candidate in open_to if candidate[0].finding is not best.cause.finding]
    prediction = run.prediction
    above = run.lines.above(prediction.counted(prediction.residuals[:, :, None])[:, :, 0])
    ratio = np.sqrt(np.mean(base.residuals**2, axis=0) / np.maximum(np.mean(above**2, axis=0), 1e-300))
    explained = 1 - float((base.residuals**2).sum() / max((run.base.residuals**2).sum(), 1e-300))
    return Judgement(named, explained, float(ratio.max()), int(np.argmax(ratio)) - len(ratio))

"""Repeated runs: whether the stated noise describes their scatter, and which of them leave the others of their pool."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from identify.display.rounding import significant
from identify.exceptions import RunError
from identify.least_squares.pooling import Pooling
from identify.results.discordance import Discordance, PoolEstimate, discordant_runs
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.run import Run

LEAST_RATIO_OF_FREEDOM = 10.0
"""Ratio of a prediction's degrees of freedom to those of the scatter from which on the prediction is used."""
LEVEL = 0.01
"""Chance that a true prediction is called false, over all components together."""


@dataclass(frozen=True)
class ScatterVerdict:
    """The scatter of repeats beside its prediction, component by component; any unit, the same for both."""

    measured: np.ndarray
    """Standard deviation of the repeats."""
    predicted: np.ndarray
    """Standard deviation of the repeats that the stated noise predicts."""
    repeats: int
    probability: np.ndarray
    """Two-sided probability of a ratio at least as far from one, if the prediction holds (chi-squared)."""
    level: float = LEVEL

    @property
    def ratio(self) -> np.ndarray:
        """Measured over predicted."""
        return self.measured / self.predicted

    @property
    def sign(self) -> np.ndarray:
        """Sign by component: 1 scatters more than predicted, −1 less, 0 neither; by Bonferroni over all."""
        differs = self.probability * len(COMPONENTS) < self.level
        return np.where(differs, np.sign(np.log(self.ratio, where=self.measured > 0, out=-np.ones(len(COMPONENTS)))), 0)

    @property
    def describes(self) -> bool:
        """Whether the stated noise describes the repeatability: no component scatters more or less than predicted."""
        return not self.sign.any()

    @property
    def text(self) -> str:
        """The verdict in one line."""
        if self.describes:
            return f"the stated noise describes the scatter of {self.repeats} repeats"
        parts = [f"{self._which(sign)} {how}" for sign, how in ((-1, "less"), (1, "more")) if (self.sign == sign).any()]
        return f"the stated noise does not describe this rig's repeatability: {' and '.join(parts)} than it predicts"

    def _which(self, sign: int) -> str:
        components = [
            f"{name} ({significant(measured, 2)} against {significant(predicted, 2)})"
            for name, measured, predicted, has_sign in zip(
                COMPONENTS, self.measured, self.predicted, self.sign == sign, strict=True
            )
            if has_sign
        ]
        return f"{', '.join(components)} scatter{'s' if len(components) == 1 else ''}"


def pooled_scatter_verdict(pooling: Pooling) -> ScatterVerdict | None:
    """Return the verdict on repeated runs of one mounting against what their residuals predict.

    None where nothing repeats, or where the prediction has too few degrees of freedom.

    Args:
        pooling: of the runs.
    """
    if pooling.between_runs is None or not (pooling.predicted > 0).all():
        return None
    if np.min(pooling.residual_degrees_of_freedom) < LEAST_RATIO_OF_FREEDOM * pooling.repeat_degrees_of_freedom:
        return None
    return scatter_verdict(pooling.between_runs, pooling.predicted, pooling.repeat_degrees_of_freedom + 1)


def scatter_verdict(
    measured: Sequence[float | int] | np.ndarray,
    predicted: Sequence[float | int] | np.ndarray,
    repeats: int,
    *,
    level: float = LEVEL,
) -> ScatterVerdict:
    """Say whether the stated noise describes a rig's repeatability.

    If it does, ``(k - 1) s²/σ²`` of a component is chi-squared with k - 1 degrees of freedom (see GUM E.4.3), where
    σ holds only what is drawn anew in each repeat: no calibration that the repeats share.

    Args:
        measured: standard deviation s of the repeats, a value per component.
        predicted: standard deviation σ that the stated noise predicts for one repeat, in the same unit.
        repeats: how many there are, k.
        level: chance that a true prediction is called false, over all components together (Bonferroni).

    Raises:
        ValueError: fewer than two repeats, shapes that differ, a negative scatter, a prediction that is not positive.
    """
    s, sigma = np.asarray(measured, float), np.asarray(predicted, float)
    if repeats < 2:
        raise ValueError(f"Argument `repeats` must be 2 or more, but is {repeats}.")
    if s.shape != sigma.shape or s.shape != (len(COMPONENTS),):
        raise ValueError(
            f"Arguments `measured` and `predicted` must have {len(COMPONENTS)} values, but have {s.shape} and "
            f"{sigma.shape}."
        )
    if not ((s >= 0) & np.isfinite(s)).all() or not ((sigma > 0) & np.isfinite(sigma)).all():
        raise ValueError("Argument `measured` must be zero or more and `predicted` above zero, and both finite.")
    statistic, freedom = (repeats - 1) * (s / sigma) ** 2, repeats - 1
    tails = np.minimum(scipy.special.chdtr(freedom, statistic), scipy.special.chdtrc(freedom, statistic))
    probability = np.minimum(2 * tails, 1.0)
    return ScatterVerdict(measured=s, predicted=sigma, repeats=repeats, probability=probability, level=level)


def discordance(
    result: Identification, runs: Sequence[Run], estimated: Callable[[list[Run]], Identification]
) -> Discordance | None:
    """Return the runs or mountings that leave the others; None: none does.

    Where the names of mountings are wrong nobody can say which runs belong together, and so which do not.

    Args:
        result: of all runs.
        runs: what it was made of.
        estimated: makes a result of some of the runs.
    """
    if {run.mounting for run in runs} != {run.mounting for run in result.runs}:
        return None
    pooling = result.pooling
    redrawn = np.zeros(6) if pooling is None else pooling.from_redrawn_sources * np.sqrt(max(pooling.mountings, 1))
    departures = discordant_runs(result.runs, redrawn)
    if not departures:
        return None
    leaving = {index for departure in departures for index in departure.indices}
    belonging = [run for index, run in enumerate(runs) if index not in leaving]
    try:
        without = _pool(estimated(belonging))
    except RunError:
        without = None
    return Discordance(departures, _pool(result), without)


def _pool(result: Identification) -> PoolEstimate:
    return PoolEstimate(len(result.runs), result.inertia, result.standard_uncertainty, result.interval95)

"""Repeats that leave the others: which of several estimates of one tensor do not belong, and in what component.

Repeats in groups, such as runs of named mountings, also say whether the groups are the right ones (:func:`misnamed`).

After the generalised extreme Studentized deviate (Rosner 1983, doi:10.1080/00401706.1983.10487848): the repeat that
departs most from the mean of the others is set aside, again and again while a majority is left, so that two of a kind
do not hide each other; discordant are those up to the last whose departure is significant. A departure must pass three
tests of Student's t, so that repeats that all scatter more than they say are no reason to blame the outermost:

- in units of the stated uncertainties, widened to the others' scatter in that component where this is more;
- in units of the others' scatter in all components together;
- in units of the others' scatter in that component alone, at a looser level, for it has few degrees of freedom.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

LEVEL = 0.01
"""Chance of a false alarm, over all repeats and all components (Bonferroni)."""
SCATTER_LEVEL, SCATTER_LEVEL_OF_THREE = 0.01, 0.05
"""Levels of the third test; of three repeats it has a single degree of freedom."""
STATED_FREEDOM = 8.0
"""Degrees of freedom that stated uncertainties count for beside the scatter."""
LEAST = 3
"""Fewest repeats of which one can leave the others."""


MISNAMED_LEVEL = 1e-3
"""Chance that groups of alike repeats are called wrong, over all quantities (Bonferroni)."""
LEAST_EXCESS = 2.0
"""Scatter within groups over the stated uncertainties from which it may contradict the groups."""
MATCHED_LEVEL = 0.05
"""Chance of groups that differ as much more than their members by accident, over all quantities, below which they are
right."""


class Misnamed(NamedTuple):
    """Scatter that contradicts the groups of repeats, in the quantity in which it is largest."""

    quantity: int
    within: float
    """Scatter within the groups over the stated uncertainties."""
    across: float
    """Scatter of the groups' means over that within them, 1 on average where the groups mean nothing."""
    certain: bool
    """Whether the groups' means scatter less than chance allows where the groups mean nothing."""


class Departure(NamedTuple):
    """Distance of a repeat from the mean of those that belong, in the component that departs most."""

    repeat: int
    """Number of the repeat among the values."""
    component: int
    difference: float
    """Repeat less the mean of those that belong [kg·m²]."""
    standard_uncertainty: float
    """Standard uncertainty of ``difference`` by the stated uncertainties [kg·m²]."""


def discordant(
    values: Float[np.ndarray, "k 6"], uncertainties: Float[np.ndarray, "k 6"], *, level: float = LEVEL
) -> tuple[Departure, ...]:
    """Return the repeats that leave the others, the farthest first; none of fewer than three.

    Args:
        values: tensor of each repeat [kg·m²].
        uncertainties: their standard uncertainties, without what they share [kg·m²].
        level: chance of naming any where all belong.
    """
    inside, aside, last = list(range(len(values))), list[int](), 0
    while len(inside) >= LEAST and len(aside) < (len(values) - 1) // 2:
        chances, significant = _chances(values[inside], uncertainties[inside], level)
        farthest = int(np.argmin(chances.min(axis=1)))
        aside.append(inside.pop(farthest))
        last = len(aside) if significant[farthest].any() else last
    belong = [*inside, *aside[last:]]
    departures = [_departure(values, uncertainties, index, belong) for index in aside[:last]]
    return tuple(sorted(departures, key=lambda d: -abs(d.difference) / d.standard_uncertainty))


def misnamed(
    values: Float[np.ndarray, "k n"], uncertainties: Float[np.ndarray, "k n"], names: Sequence[str], freedom: float
) -> Misnamed | None:
    """Return whether repeats of one name differ more than they say, and no less than those of different names.

    After the analysis of variance. A single repeat that leaves the others is no evidence: without it the others of its
    name must differ, too.

    Args:
        values: of each repeat.
        uncertainties: their standard uncertainties, without what they share.
        names: of each repeat's group; two groups or more, else None is returned.
        freedom: degrees of freedom of the uncertainties.
    """
    weights, groups = uncertainties**-2, np.array([[name == label for name in names] for label in dict.fromkeys(names)])
    count, quantities = len(values) - len(groups), values.shape[1]
    if len(groups) < 2 or count < 2:
        return None
    within, _ = _squares(values, weights, groups)
    others = ~np.eye(len(values), dtype=bool)
    least = np.min([_squares(values[kept], weights[kept], groups[:, kept])[0] for kept in others], axis=0)
    inside, across = _squares(values, np.ones_like(weights), groups)  # a scatter beyond the noise weighs all alike
    ratio = (across / (len(groups) - 1)) / np.maximum(inside / count, 1e-300)
    matched = scipy.special.fdtrc(len(groups) - 1, count, ratio) < MATCHED_LEVEL / quantities
    excess = scipy.special.fdtrc(count - 1, freedom, least / (count - 1)) < MISNAMED_LEVEL / quantities
    excess &= least > LEAST_EXCESS**2 * (count - 1)
    if matched.any() or not excess.any():
        return None
    at = int(np.argmax(np.where(excess, within, 0.0)))
    certain = bool(scipy.special.fdtr(len(groups) - 1, count, ratio[at]) < MATCHED_LEVEL)
    return Misnamed(at, float(np.sqrt(within[at] / count)), float(np.sqrt(ratio[at])), certain)


def _squares(values: np.ndarray, weights: np.ndarray, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted squares of the differences from each group's mean, and of these from the mean of all, (n,) each."""
    groups = groups[groups.any(axis=1)].astype(float)
    values = values - np.median(values, axis=0)  # differences of large squares would lose digits
    totals = groups @ weights
    means = groups @ (weights * values) / totals
    overall = (totals * means).sum(axis=0) / totals.sum(axis=0)
    within = (weights * (values - groups.T @ means) ** 2).sum(axis=0)
    return within, (totals * (means - overall) ** 2).sum(axis=0)


def _chances(values: np.ndarray, uncertainties: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """The larger probability of the first two tests, and whether all three call the departure significant, (n, 6)."""
    values = values - np.median(values, axis=0)  # differences of large squares would lose digits
    count, weight = len(values), uncertainties**-2
    other_weights = weight.sum(axis=0) - weight
    mean = ((weight * values).sum(axis=0) - weight * values) / other_weights
    squares = (weight * values**2).sum(axis=0) - weight * values**2 - other_weights * mean**2
    squares, freedom = np.maximum(squares, 1e-12), float(count - 2)
    stated = np.abs(values - mean) / np.sqrt(uncertainties**2 + 1 / other_weights)

    def chance(variance: np.ndarray, degrees: float) -> np.ndarray:
        return 2 * scipy.special.stdtr(degrees, -stated / np.sqrt(variance))

    widened = np.maximum((STATED_FREEDOM + squares) / (STATED_FREEDOM + freedom), 1.0)
    together = squares.sum(axis=1, keepdims=True) / (6 * freedom)
    chances = np.maximum(chance(widened, STATED_FREEDOM + freedom), chance(together, 6 * freedom))
    loose = SCATTER_LEVEL_OF_THREE if count == LEAST else SCATTER_LEVEL
    return chances, (chances < level / (6 * count)) & (chance(squares / freedom, freedom) < loose)


def _departure(values: np.ndarray, uncertainties: np.ndarray, index: int, belong: Sequence[int]) -> Departure:
    weight = uncertainties[belong] ** -2
    mean = (weight * values[belong]).sum(axis=0) / weight.sum(axis=0)
    difference, u = values[index] - mean, np.sqrt(uncertainties[index] ** 2 + 1 / weight.sum(axis=0))
    component = int(np.argmax(np.abs(difference) / u))
    return Departure(index, component, float(difference[component]), float(u[component]))

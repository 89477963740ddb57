"""Repeats that leave the others: which of several estimates of one tensor do not belong, and in what component.

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

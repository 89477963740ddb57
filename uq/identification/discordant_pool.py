"""Does every run belong to its pool? Those that leave the others are named, and the pool is given without them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from identify.exceptions import RunError
from identify.results.discordance import Discordance, PoolEstimate, discordant_runs
from identify.results.identification_result import Identification
from identify.signals.run import Run


def with_discordance(
    result: Identification, runs: Sequence[Run], estimated: Callable[[list[Run]], Identification]
) -> Identification:
    """Return a result with the runs or mountings that leave the others, and a warning of each; else unchanged.

    Args:
        result: of all runs.
        runs: what it was made of.
        estimated: makes a result of some of the runs.
    """
    pooling = result.pooling
    redrawn = np.zeros(6) if pooling is None else pooling.from_redrawn_sources * np.sqrt(max(pooling.mountings, 1))
    departures = discordant_runs(result.runs, redrawn)
    if not departures:
        return result
    leaving = {index for departure in departures for index in departure.indices}
    belonging = [run for index, run in enumerate(runs) if index not in leaving]
    try:
        without = _pool(estimated(belonging))
    except RunError:
        without = None
    discordance = Discordance(departures, _pool(result), without)
    return replace(result, warnings=(*result.warnings, *discordance.warnings), discordance=discordance)


def _pool(result: Identification) -> PoolEstimate:
    return PoolEstimate(len(result.runs), result.inertia, result.standard_uncertainty, result.interval95)

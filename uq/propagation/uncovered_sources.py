"""Sources that the law of propagation does not cover, listed together, and how to leave them out."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identify.rounding import significant
from rig.exceptions import listed, quoted
from uq.files.mistakes import ExperimentError
from uq.sources.draws import Mixing
from uq.sources.source import SignalRange, Source, signal_variance

LONGEST = 140
"""Most characters of sources and options that a message gives in full."""


class Peaks(NamedTuple):
    """Largest values of a noise-free signal, and of its change between samples (rms), on each axis."""

    largest: Mapping[str, np.ndarray]
    moves: Mapping[str, np.ndarray]


ANYWHERE = Peaks(
    {name: np.zeros(3) for name in ("F", "M", "omega")}, {name: np.full(3, np.inf) for name in ("F", "M", "omega")}
)
"""Peaks of a motion that is not yet known: no range ends within its reach, and no step is coarse."""


class BeyondLawError(ExperimentError):
    """Sources that the law does not take, each with the reason, and its share of the 3σ where that is known."""

    def __init__(self, reasons: Mapping[str, str], shares: Mapping[str, float] | None = None) -> None:
        self.reasons, self.shares = dict(reasons), {k: v for k, v in (shares or {}).items() if k in reasons}
        names = [name if name.isidentifier() else quoted(name) for name in self.reasons]
        options = " ".join(f"--without {name}" for name in names)
        sources = ", ".join(f"{quoted(name)} {reason}{self._share(name)}" for name, reason in self.reasons.items())
        if len(sources) + len(options) > LONGEST:
            sources = listed(f"{name}{self._share(name)}" for name in self.reasons)
        if len(sources) + len(options) > LONGEST:
            options = "--without NAME"
        super().__init__(f"the law does not take: {sources}; leave out ({options}), or use the Monte Carlo")

    def _share(self, name: str) -> str:
        share = self.shares.get(name)
        return "" if share is None else f" (alone {significant(100 * share, 2)} % of the 3σ)"


def beyond_the_law(sources: Sequence[Source], mixing: Sequence[Mixing], peaks: Peaks) -> dict[str, str]:
    """Return the sources that the law does not take, each with the reason.

    Args:
        sources: all of them.
        mixing: which are correlated.
        peaks: how far the noise-free signals go.
    """
    reasons = {source.name: _reason(source, sources, mixing, peaks) for source in sources}
    return {name: reason for name, reason in reasons.items() if reason}


def beyond_the_prediction(sources: Sequence[Source], mixing: Sequence[Mixing], peaks: Peaks) -> dict[str, str]:
    """Return the same of what :mod:`uq.propagation.prediction` does not take, either."""
    entrained = [source.name for source in sources if source.perturbs == "entrained_air"]
    return {
        **beyond_the_law(sources, mixing, peaks),
        **dict.fromkeys(entrained, "is not in the prediction of a motion"),
    }


def check_law(sources: Sequence[Source], mixing: Sequence[Mixing], peaks: Peaks) -> None:
    """Refuse sources that the law does not take; see :func:`beyond_the_law`.

    Raises:
        BeyondLawError: there are such.
    """
    if reasons := beyond_the_law(sources, mixing, peaks):
        raise BeyondLawError(reasons)


def _reason(source: Source, sources: Sequence[Source], mixing: Sequence[Mixing], peaks: Peaks) -> str | None:
    if source.constant and not np.all(np.isfinite(np.asarray(source.standard_deviation, float))):
        return "has no finite standard deviation (state more than two degrees of freedom)"
    if source.signal is None:
        return None
    correlations = [mix.correlation for mix in mixing if source.name in mix.names]
    signal = SignalRange(
        largest=peaks.largest[source.target], moves=peaks.moves[source.target],
        variance=signal_variance(sources, source.signal),
        correlated=any(not np.array_equal(matrix, np.eye(len(matrix))) for matrix in correlations),
    )  # fmt: skip
    return source.error_kind.beyond_the_law(source, signal)

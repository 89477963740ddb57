"""Sources that the law of propagation does not cover, listed together, and how to leave them out."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identify.display.rounding import significant
from rig.exceptions import listed, quoted
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.gram_sums.cases import cases_of
from uq.sources.draws import Mixing
from uq.sources.noise_filters import WHITE
from uq.sources.source import (
    EVERY_SAMPLE,
    SIGNALS,
    SignalRange,
    Source,
    disturbs,
    normal_noise_variance,
    signal_variance,
)

LONGEST = 140
"""Most characters of sources and options that a message gives in full."""


class Peaks(NamedTuple):
    """Range and speed of the noise-free signals of a run, axis by axis."""

    largest: Mapping[str, np.ndarray]
    """Largest absolute value."""
    moves: Mapping[str, np.ndarray]
    """Root mean square of the change from one sample to the next."""
    rests: Mapping[str, np.ndarray]
    """Part of the run without such a change."""
    rate: float
    """Rate of the samples [Hz]."""


def _on_axes(value: float) -> Mapping[str, np.ndarray]:
    return {name: np.full(3, value) for name in SIGNALS}


ANYWHERE = Peaks(largest=_on_axes(0.0), moves=_on_axes(np.inf), rests=_on_axes(0.0), rate=1.0)
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
    """Return the sources that :mod:`uq.analysis.propagation.prediction` does not take, each with the reason."""
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
    if source.constant and source.perturbs is None:
        return EVERY_SAMPLE
    if source.signal is None:
        return None
    if source.noise and (reason := _noise_beyond_law(source, mixing)):
        return reason
    signal = SignalRange(
        largest=peaks.largest[source.target], moves=peaks.moves[source.target], rests=peaks.rests[source.target],
        variance=signal_variance(sources, source.signal), noise=_noise_beside(source, sources, peaks.rate),
        same_kind=tuple(
            other for other in sources
            if other.name != source.name and other.error_kind is source.error_kind and other.signal == source.signal
        ),
    )  # fmt: skip
    return source.error_kind.beyond_the_law(source, signal)


def _noise_beyond_law(source: Source, mixing: Sequence[Mixing]) -> str | None:
    """Reason for which the law does not take noise: its memory, or correlations of the gyro's axes."""
    if any(part.filter != WHITE for part in source.noise_parts(1.0) or ()):
        return "is noise that is not white"
    correlations = [mix.correlation for mix in mixing if source.of_gyro and source.name in mix.names]
    correlated = any(not np.array_equal(matrix, np.eye(len(matrix))) for matrix in correlations)
    return "is gyro noise with correlations" if correlated else None


def _noise_beside(source: Source, sources: Sequence[Source], rate: float) -> np.ndarray:
    """Standard deviation of normal white noise beside a source in the cases in which its signal has a random error."""
    noise = [np.zeros((0, 3))]
    for case in cases_of(sources):
        beside = [s for s in sources if source.name in case.sources and s.name in case.sources]
        if any(disturbs(other, source) for other in beside):
            variance = normal_noise_variance((s for s in beside if s.signal == source.signal), rate)
            noise.append(np.sqrt(variance)[None])
    return np.concatenate(noise)

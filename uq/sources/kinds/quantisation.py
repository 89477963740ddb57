"""Quantisation: a sensor's finite resolution."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from uq.sources.noise_filters import WHITE, NoisePart
from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source, strictest

ENOUGH_STEPS = 1.0
"""Steps by which a signal must move from sample to sample (rms) for its rounding to be white rectangular noise."""

LONGEST_REST = 0.05
"""Part of a run that a signal may rest, at the starts and ends of its motions: by that part its rounding's variance is
less than a moving signal's."""

STEPS_OF_NOISE = 0.5
"""Standard deviation of a signal's normal noise, in steps, from which its rounding acts as independent noise. The mean
rounding error at a given value of the signal is then at most ``exp(-2π² σ²/q²)/π`` = 0.0023 steps q, and its
correlation with the noise below 0.015: Widrow & Kollár, Quantization Noise, 2008, chapter 4 and appendix G."""


class Quantisation(ErrorKind):
    """Rounds a signal to the nearest multiple of ``step``; nothing is drawn."""

    name = "quantisation"
    targets = SIGNAL_UNITS
    absence = "the resolution of {} is unlimited"
    in_sums_as = "white noise of variance step²/12"
    sizes = {"step": "{}"}
    stage = 20

    def sensed(
        self, signal: Float[Array, "3 n"], sources: Sequence[Source], acting: Sequence[Any]
    ) -> Float[Array, "3 n"]:
        """Return the signal, rounded to the coarsest of the steps."""
        steps = [source.settings["step"] for source in sources]
        return quantised(signal, strictest(steps, acting, jnp.maximum, jnp.zeros((3, 1), signal.dtype)))

    def noise_parts(self, source: Source, rate: Any) -> list[NoisePart]:
        """Return white noise of an error between plus and minus half a step, of variance step²/12.

        Rectangular of each sample; normal in sums, which over many samples do not tell the difference.
        """
        return [NoisePart(WHITE, np.sqrt(np.square(source.settings["step"]) / 12))]

    def beyond_sums(self, source: Source, signal: SignalRange) -> str | None:
        """Return that rounding does not act as noise: the signal's own is not large enough (Widrow & Kollár)."""
        if signal.same_kind:
            return "is one of several resolutions of a signal"
        coarse = np.any(STEPS_OF_NOISE * np.asarray(source.settings["step"]) > signal.noise)
        return "is coarse against the noise beside it" if coarse else None

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return why a rounding is not the white noise of its step: a coarser one acts, or little noise and motion.

        Where nothing random acts on the signal, the rounding needs neither: it is the same in every trial.
        """
        step = np.asarray(source.settings["step"])
        if any(_acts(other, source) for other in signal.same_kind):
            return "is finer than another resolution of its signal"
        bare = (STEPS_OF_NOISE * step > signal.noise).any(axis=0)
        slow, still = bare & (step * ENOUGH_STEPS > signal.moves), bare & (signal.rests > LONGEST_REST)
        if not (slow | still).any():
            return None
        axis = int(np.argmax(np.where(slow | still, step / np.maximum(signal.moves, 1e-300), -1)))
        rest = f"rests in {100 * signal.rests[axis]:.0f} % of the run"
        how = rest if still[axis] else f"moves by {signal.moves[axis]:.2g} a sample"
        return f"rounds axis {axis + 1} to {step[axis]:g}, which {how} with noise below half a step"


def _acts(other: Source, source: Source) -> bool:
    """Whether another step acts in place of a source's, on some axis: the coarser one, of equal ones the first."""
    coarse, fine = (np.asarray(resolution.settings["step"]) for resolution in (other, source))
    return bool(np.any(coarse > fine) or (np.array_equal(coarse, fine) and other.name < source.name))


def quantised(signal: Float[Array, "3 n"], step: Float[Array, "3 1"]) -> Float[Array, "3 n"]:
    """Round to the nearest multiple of a step; zero leaves the signal as it is."""
    return jnp.where(step > 0, step * jnp.round(signal / jnp.where(step > 0, step, 1)), signal)

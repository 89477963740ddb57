"""Saturation: the end of a sensor's range."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source
from uq.sources.source_figures import strictest

MANY_SIGMA = 6.0
"""Standard deviations that must fit between a signal and the end of its range for the range not to matter."""


class Saturation(ErrorKind):
    """Clips a signal at ± ``limit``; nothing is drawn."""

    name = "saturation"
    targets = SIGNAL_UNITS
    absence = "the range of {} is unlimited"
    needs_samples = True
    sizes = ("limit",)
    stage = 10

    def resized(self, source: Source, factor: float) -> Source:
        """Return the source as it is: a range has no error's size."""
        return source

    def sensed(
        self,
        signal: Float[Array, "3 n"],
        sources: Sequence[Source],
        acting: Sequence[Any],
        draws: Mapping[str, Array],
    ) -> Float[Array, "3 n"]:
        """Return the signal within the narrowest of the ranges."""
        limits = [source.settings["limit"] for source in sources]
        limit = strictest(limits, acting, jnp.minimum, jnp.full((3, 1), jnp.inf, signal.dtype))
        return jnp.clip(signal, -limit, limit)

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return that it cuts its signal off, unless the signal stays well within the range."""
        reach = signal.largest + MANY_SIGMA * np.sqrt(signal.variance)
        if np.any(reach > np.asarray(source.settings["limit"])):
            return "cuts its signal off"
        return None

"""Saturation: the end of a sensor's range."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source, strictest


class Saturation(ErrorKind):
    """Clips a signal at ± ``limit``; nothing is drawn."""

    name = "saturation"
    targets = SIGNAL_UNITS
    absence = "the range of {} is unlimited"
    in_sums_as = "nothing: the signal stays within its range"
    sizes = {"limit": "{}"}
    stage = 10

    def sensed(
        self, signal: Float[Array, "3 n"], sources: Sequence[Source], acting: Sequence[Any]
    ) -> Float[Array, "3 n"]:
        """Return the signal within the narrowest of the ranges."""
        limits = [source.settings["limit"] for source in sources]
        limit = strictest(limits, acting, jnp.minimum, jnp.full((3, 1), jnp.inf, signal.dtype))
        return jnp.clip(signal, -limit, limit)

    def beyond_sums(self, source: Source, signal: SignalRange) -> str | None:
        """Return that the signal does not stay well within its range, where sums would not feel its end."""
        near = np.any(signal.reach > np.asarray(source.settings["limit"]))
        return "is within reach of the signal" if near else None

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return that it cuts its signal off, unless the signal stays well within the range."""
        return "cuts its signal off" if np.any(signal.reach > np.asarray(source.settings["limit"])) else None

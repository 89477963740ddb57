"""Coloured noise from its Allan parameters: white noise, flicker and random walk.

With the two-sided spectrum ``N² + B² / (2π f) + K² / (2π f)²`` of IEEE Std 952-1997, annex C, the Allan variance at
averaging time τ is ``N²/τ + (2 ln 2/π) B² + K² τ/3``.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from rig.toml_tables import WrongKeyError
from uq.sources.draw_figures import figures
from uq.sources.flicker import FLICKER
from uq.sources.noise_filters import WALK, WHITE, NoisePart
from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source

UNITS = {"white": "{}*s**0.5", "flicker": "{}", "random_walk": "{}/s**0.5"}
"""Units of N, B and K: angle random walk, bias instability and rate random walk of an angular velocity."""


class Coloured(ErrorKind):
    """Adds noise with these Allan parameters; flicker and random walk start from zero at the run's start."""

    name = "coloured"
    targets = SIGNAL_UNITS
    absence = "the noise of {} has neither flicker nor a random walk"
    sizes = UNITS

    def keys(self, target: str) -> dict[str, Any]:
        """Return the three parameters, each of which may be missing."""
        units = {name: self.unit_of_size(target, name) for name in UNITS}
        return {name: Annotated[np.ndarray, figures(unit, self.shape, least=0)] | None for name, unit in units.items()}

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the parameters that are stated: nothing is drawn for the others."""
        stated = {name: keys[name] for name in UNITS if keys[name] is not None}
        if not stated:
            raise WrongKeyError("white", f"give {', '.join(UNITS)} or some of them")
        return stated

    def noise_parts(self, source: Source, rate: Any) -> list[NoisePart]:
        """Return white noise, flicker and a running sum, those that are stated."""
        N, B, K = (source.settings.get(name) for name in UNITS)
        white = [] if N is None else [NoisePart(WHITE, N * rate**0.5, 0)]
        flicker = [] if B is None else [NoisePart(FLICKER, B, 1)]
        walk = [] if K is None else [NoisePart(WALK, K / rate**0.5, 2)]
        return [*white, *flicker, *walk]

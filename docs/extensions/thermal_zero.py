"""Shift of the load cell's zero with its temperature since it was zeroed."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from uq.files.schema import in_unit
from uq.sources.source import Draw, ErrorKind, Source


class ThermalZero(ErrorKind):
    """Adds θ ΔT to the signal, ΔT the stated change of temperature."""

    name = "thermal_zero"
    targets = {"F": "N/K", "M": "N*m/K"}
    absence = "temperature does not shift the zero of {}"
    perturbs = {"F": "cell_bias", "M": "cell_bias"}

    def keys(self, target: str) -> dict[str, Any]:
        """Return the key of the change of temperature [K]."""
        return {"warmer": Annotated[float, in_unit("K")]}

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the change of temperature [K]."""
        return {"warmer": np.array(keys["warmer"])}

    def value(self, source: Source, draw: Draw) -> Draw:
        """Return what it adds to the biases of the force, or of the moment."""
        return draw * source.settings["warmer"]

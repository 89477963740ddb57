"""The mass measured by a load cell against the mass from a scale: a check of the cell's gain."""

from dataclasses import asdict, dataclass
from typing import Any

from identify.display.rounding import with_uncertainty

CONTRADICTION = 1.5
"""|E_n| above which the scale's mass is not combined with the load cell's: three standard uncertainties."""


@dataclass(frozen=True)
class GainCheck:
    """Mass from the load cell over mass from the scale."""

    mass: float
    """Mass from the scale [kg]."""
    standard_uncertainty: float
    """Standard uncertainty of the scale's mass [kg]."""
    ratio: float
    """The load cell's mass over the scale's: the gain of its force, where gravity is right."""
    ratio_standard_uncertainty: float
    """Standard uncertainty of the ratio."""
    coverage_factor: float
    """Coverage factor of the interval of 95 %."""

    @property
    def normalised(self) -> float:
        """Deviation of the ratio from 1 over its expanded uncertainty: |E_n| of ISO/IEC 17043."""
        return abs(self.ratio - 1) / (self.coverage_factor * self.ratio_standard_uncertainty)

    @property
    def within(self) -> bool:
        """Whether the ratio is 1 within its expanded uncertainty."""
        return self.normalised <= 1

    @property
    def contradicts(self) -> bool:
        """Whether the two differ by more than chance explains, which happens once in 300 times."""
        return self.normalised > CONTRADICTION

    @property
    def verdict(self) -> str:
        """The check in words."""
        figures = f"{with_uncertainty(self.ratio, self.ratio_standard_uncertainty)}, E_n {self.normalised:.2f}"
        text = f"load cell's mass over the scale's {figures}"
        return f"{text}: {'the gain agrees' if self.within else 'the load cell, or gravity, is off'}"

    def to_dict(self) -> dict[str, Any]:
        """Return its content in centre.json."""
        return asdict(self) | {"normalised": self.normalised, "within": self.within}


def gain_check(mass: float, sigma: float, cell_mass: float, sigma_cell_mass: float, factor: float) -> GainCheck:
    """Return the check of a load cell's mass [kg] against a scale's, each with its standard uncertainty."""
    mass, sigma = float(mass), float(sigma)  # JSON does not take NumPy scalars
    ratio = cell_mass / mass
    spread = ratio * ((sigma / mass) ** 2 + (sigma_cell_mass / cell_mass) ** 2) ** 0.5
    return GainCheck(
        mass=mass, standard_uncertainty=sigma, ratio=ratio, ratio_standard_uncertainty=spread, coverage_factor=factor
    )

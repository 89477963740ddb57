"""Units of force and moment by mechanics: the pair under which one body explains the run as it is declared.

With force and moment in units of u_F and u_M, the mass is u_F m, the centre of gravity u_M / u_F r, the tensor u_M I by
what the numbers alone show. Three statements compare: the declared mass and centre of gravity; the lever from the IMU,
which the force tells in metres; and a body's density, between that of air and that of the heaviest element. The load
cell's zeros are free. Without a declared mass a factor that force and moment share leaves no trace but in the density.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identify.judge.conventions import convention_fit
from identify.judge.conventions.axis_hypotheses import DECISIVE, EQUAL, Scales
from identify.judge.conventions.convention_fit import (
    FORCE_TERMS,
    MASS_AT,
    MOMENT_TERMS,
    CentreFit,
)
from identify.judge.conventions.convention_sums import FORCE, MOMENT, ConventionSums, DeclaredRig, Matrix, Vector
from identify.judge.conventions.removed_weight import AIR, CERTAIN, density

POUND_FORCE, KILOGRAM_FORCE, INCH, FOOT = 4.4482216152605, 9.80665, 0.0254, 0.3048
SYSTEMS = {
    ("N", 1.0): {"N*m": 1.0, "N*mm": 1e-3, "N*cm": 1e-2},
    ("lbf", POUND_FORCE): {"lbf*inch": POUND_FORCE * INCH, "lbf*ft": POUND_FORCE * FOOT},
    ("kgf", KILOGRAM_FORCE): {"kgf*m": KILOGRAM_FORCE, "kgf*cm": KILOGRAM_FORCE * 1e-2},
    ("kN", 1e3): {"kN*m": 1e3},
}
"""Units of moment beside those of force, with their size in SI.

Definition: NIST SP 811, B.8.
"""
LEVER_ALIKE = 1.5
"""Factor between the levers of two pairs of units within which units of two systems are not named.

Choice: a drawing of the centre of gravity may be as wrong.
"""
COSTS = {"one system": 2.0, "two systems": 6.0}
"""Chi-square that other units must gain before they count as equally good.

Choice: the order alone counts, the likelier mistake first; all are far below ``DECISIVE``.
"""
UNIT_TOLERANCE = 0.1
"""Departure of a ratio from that of a unit, as a standard deviation.

Choice: as a gain error and a rounded mass have together; no two units of force are so near.
"""
DRAWN = 3e-3
"""Standard deviation of a declared centre of gravity, beside the stated one, and of a declared IMU's place [m].

Choice: a drawing is no better.
"""
IMU_AT_Q = 15e-3
"""Distance of an IMU from Q where no position is declared, as a standard deviation of each coordinate [m].

Prior: our choice; the estimate takes it to be at Q.
"""
HEAVIEST = 25e3
"""Mass over the cube of twice the gyration radius above which no body is [kg/m³].

Definition: that of a ball of osmium, 22,590 kg/m³ times 1.13.
"""


@dataclass(frozen=True)
class UnitReading:
    """A pair of units, by the factors from the numbers as declared to SI."""

    force: str
    moment: str
    force_factor: float
    moment_factor: float
    cost: float = 0.0

    @property
    def declared(self) -> bool:
        """Whether these are the units that are declared."""
        return self.cost == 0.0

    @property
    def lever_factor(self) -> float:
        """Factor of every lever that force and moment tell."""
        return self.moment_factor / self.force_factor

    def applied(self, sums: ConventionSums) -> ConventionSums:
        """The sums as they would be."""
        return sums.scaled(FORCE, self.force_factor).scaled(MOMENT, self.moment_factor)

    def lines(self) -> str:
        """The keys of the units that differ from those declared."""
        units = {"force": (self.force, self.force_factor), "moment": (self.moment, self.moment_factor)}
        return " and ".join(f'{key}_unit = "{name}"' for key, (name, factor) in units.items() if factor != 1.0)


def unit_readings(force_unit: float, moment_unit: float) -> Iterator[UnitReading]:
    """Return all pairs of units, those declared first.

    Args:
        force_unit: newtons in the declared unit of force.
        moment_unit: newton metres in the declared unit of moment.
    """
    yield UnitReading("", "", 1.0, 1.0)
    moments = [(force, name, size) for (force, _), group in SYSTEMS.items() for name, size in group.items()]
    for force, force_size in SYSTEMS:
        for system, moment, moment_size in moments:
            factors = _rounded(force_size / force_unit), _rounded(moment_size / moment_unit)
            alike = 1 / LEVER_ALIKE < factors[1] / factors[0] < LEVER_ALIKE
            if factors != (1.0, 1.0) and (system == force or (1.0 in factors and not alike)):
                cost = COSTS["one system" if system == force else "two systems"]
                yield UnitReading(force, moment, *factors, cost)


def _rounded(factor: float) -> float:
    """A factor of units, free of rounding where it is one."""
    return 1.0 if abs(factor - 1.0) < 1e-9 else factor


@dataclass(frozen=True, eq=False)
class BodyByWrench:
    """The body that force and moment show, in the units as declared."""

    sums: ConventionSums
    given: Scales
    mass: float
    """Mass whose weight the force is [kg]."""
    uncertainty: float
    """Expanded uncertainty of the mass [kg]."""
    centre: CentreFit
    """Centre of gravity from Q, by r × F."""
    by_motion: bool = False
    """Whether the force's changes determine the mass, and so the lever."""

    @cached_property
    def _lever(self) -> tuple[Vector, Matrix] | None:
        """Centre of gravity from the IMU, by the force alone, and its covariance; None: the force does not tell it."""
        if not self.by_motion:
            return None
        priors = replace(self.given, offset=np.inf, lever=np.inf).priors
        fit = convention_fit.solve(self.sums, FORCE_TERMS, FORCE, variance=self.given.force, priors=priors)
        lever, mass = slice(MASS_AT.stop, MASS_AT.stop + 3), float(fit.values[0])
        return fit.values[lever] / mass, fit.covariance[lever, lever] / mass**2

    @cached_property
    def _trace(self) -> tuple[float, float]:
        """The tensor's trace, and its standard uncertainty."""
        return convention_fit.solve(self.sums, MOMENT_TERMS, MOMENT, variance=self.given.moment).trace

    def misfit(self, reading: UnitReading, declared: DeclaredRig) -> float:
        """Chi-square of what is declared against the body in other units; infinite where no body is so."""
        mass = reading.force_factor * self.mass
        if self._impossible(reading, mass):
            return np.inf
        chi_square, factor = reading.cost, reading.lever_factor
        if declared.mass is not None:
            relative = np.hypot(UNIT_TOLERANCE, self.uncertainty / self.mass)
            chi_square += float(np.log(mass / declared.mass) / relative) ** 2
        r, covariance = factor * self.centre.r, factor**2 * self.centre.covariance
        if declared.r_cg is not None:
            sigma = np.zeros(3) if declared.sigma_r_cg is None else declared.sigma_r_cg
            chi_square += self._distance(declared.r_cg - r, covariance + np.diag(sigma**2 + DRAWN**2))
        if self._lever is not None:
            lever, spread = self._lever
            at, sigma_at = (np.zeros(3), IMU_AT_Q) if declared.imu_position is None else (declared.imu_position, DRAWN)
            chi_square += self._distance(at + lever - r, covariance + spread + sigma_at**2 * np.eye(3))
        return chi_square

    def _distance(self, shift: Vector, covariance: Matrix) -> float:
        seen = shift - self.centre.undetermined @ shift
        return float(seen @ np.linalg.solve(covariance, seen))

    def _impossible(self, reading: UnitReading, mass: float) -> bool:
        """Whether no body has this mass with these moments."""
        trace, spread = self._trace
        smallest, largest = (reading.moment_factor * (trace + sign * CERTAIN * spread) for sign in (-1, 1))
        return bool(density(mass, smallest) < AIR or density(mass, largest) > HEAVIEST)


def other_units(body: BodyByWrench, declared: DeclaredRig) -> list[UnitReading]:
    """Return the units that explain the run far better than those declared, the best first; none where none do."""
    readings = list(unit_readings(*declared.units))
    scores = [body.misfit(reading, declared) for reading in readings]
    least = min(scores)
    if not least < min(scores[0] - DECISIVE, DECISIVE):
        return []
    order = [k for k in np.argsort(scores) if scores[k] < least + EQUAL]
    return [readings[k] for k in order]

"""Units of force and moment under which mass, lever and density are those of a body, for runs and static poses alike.

With force and moment in units of u_F and u_M, the mass is u_F m, the centre of gravity u_M / u_F r, the tensor u_M I by
what the numbers alone show. Three statements compare: the declared mass and centre of gravity; the lever from the IMU,
which the force tells in metres; and a body's density, between that of air and that of the heaviest element. The load
cell's zeros are free. Without a declared mass a factor that force and moment share leaves no trace but in the density.

At rest no tensor is known. The distance r of the centre of gravity from Q then stands for the gyration radius: about Q
the body's is no smaller.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from identify.judge.conventions import convention_fit
from identify.judge.conventions.axis_hypotheses import DECISIVE, EQUAL, Scales
from identify.judge.conventions.convention_fit import (
    FORCE,
    FORCE_TERMS,
    MASS_AT,
    MOMENT,
    MOMENT_TERMS,
    CentreFit,
    ConventionSums,
    DeclaredRig,
    Matrix,
    Vector,
)
from identify.judge.conventions.removed_weight import AIR, CERTAIN, density
from identify.judge.cure import Entries

POUND_FORCE, KILOGRAM_FORCE, INCH, FOOT = 4.4482216152605, 9.80665, 0.0254, 0.3048
SYSTEMS = {
    ("N", 1.0): {"N*m": 1.0, "N*mm": 1e-3, "N*cm": 1e-2},
    ("lbf", POUND_FORCE): {"lbf*inch": POUND_FORCE * INCH, "lbf*ft": POUND_FORCE * FOOT},
    ("kgf", KILOGRAM_FORCE): {"kgf*m": KILOGRAM_FORCE, "kgf*cm": KILOGRAM_FORCE * 1e-2},
    ("kN", 1e3): {"kN*m": 1e3},
    ("mN", 1e-3): {"mN*m": 1e-3},
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
CONSISTENT = 30.0
"""Chi-square, of up to seven degrees of freedom, above which units explain nothing.

Chance: 1e-4. Of the right units 1 to 7.
"""
FARTHEST = 0.5
"""Choice: distance of another point up to which it is a rival of another unit of the moment; no rig is larger [m]."""
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
USUAL = 1e3
"""Mass over the cube of twice the lever of a usual body on a load cell [kg/m³].

Choice: that of water; a factor of ten counts as a standard deviation, and only ranks units that are possible.
"""
MOST_UNUSUAL = 16.0
"""Choice: largest chi-square of an unusual lever, below what decides: balanced bodies and long rods are sound."""
BALANCED = 200.0
"""Part of the heaviest body's gyration radius below which all levers at rest are too short for any rig.

Choice: a body of 2 kg is balanced about Q to 0.1 mm only where the scatter of the moment, over that of the force, still
tells a lever of some millimetres, which is the load cell's own.
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

    @property
    def entries(self) -> Entries:
        """The keys of the units that differ from those declared."""
        units = {"force_unit": (self.force, self.force_factor), "moment_unit": (self.moment, self.moment_factor)}
        return Entries({key: name for key, (name, factor) in units.items() if factor != 1.0})


DECLARED = UnitReading("", "", 1.0, 1.0)


def unit_readings(force_unit: float, moment_unit: float) -> Iterator[UnitReading]:
    """Return all pairs of units, those declared first, and of equal ones the likelier mistake.

    Args:
        force_unit: newtons in the declared unit of force.
        moment_unit: newton metres in the declared unit of moment.
    """
    yield DECLARED
    moments = [(force, name, size) for (force, _), group in SYSTEMS.items() for name, size in group.items()]
    named: dict[tuple[float, float], UnitReading] = {}
    for force, force_size in SYSTEMS:
        for system, moment, moment_size in moments:
            factors = _rounded(force_size / force_unit), _rounded(moment_size / moment_unit)
            alike = 1 / LEVER_ALIKE < factors[1] / factors[0] < LEVER_ALIKE
            if factors != (1.0, 1.0) and (system == force or (1.0 in factors and not alike)):
                cost = COSTS["one system" if system == force else "two systems"]
                reading = UnitReading(force, moment, *factors, cost)
                if factors not in named or cost < named[factors].cost:
                    named[factors] = reading
    yield from named.values()


def _rounded(factor: float) -> float:
    """A factor of units, free of rounding where it is one."""
    return 1.0 if abs(factor - 1.0) < 1e-9 else factor


class LeverByForce(NamedTuple):
    """Centre of gravity from the IMU, by the force alone."""

    r: Vector
    """Vector from the IMU [m]."""
    covariance: Matrix
    """Covariance matrix of ``r`` [m²]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyByWrench:
    """The body that force and moment show, in the units as declared."""

    mass: float
    """Mass whose weight the force is [kg]."""
    uncertainty: float
    """Expanded uncertainty of the mass [kg]."""
    centre: CentreFit
    """Centre of gravity from Q, by the moment."""
    lever: LeverByForce | None = None
    """Centre of gravity from the IMU; None: the force does not tell it."""
    trace: tuple[float, float] | None = None
    """Trace of the tensor and its standard uncertainty [kg·m²]; None: the body rests."""
    scatter: float = 0.0
    """Scatter of the moment at rest over that of the force [m]."""

    def misfit(self, reading: UnitReading, declared: DeclaredRig) -> float:
        """Chi-square of what is declared against the body in other units; infinite where no body is so."""
        mass = reading.force_factor * self.mass
        if self.impossible(reading):
            return np.inf
        chi_square, factor = reading.cost, reading.lever_factor
        if declared.mass is not None:
            relative = np.hypot(UNIT_TOLERANCE, self.uncertainty / self.mass)
            chi_square += float(np.log(mass / declared.mass) / relative) ** 2
        if self.trace is None:
            chi_square += self._unusual(factor, mass)
        r, covariance = factor * self.centre.r, factor**2 * self.centre.covariance
        if declared.r_cg is not None:
            chi_square += self._distance(declared.r_cg - r, covariance + np.diag(declared.sigma_r_cg**2 + DRAWN**2))
        if self.lever is not None:
            at, sigma_at = (np.zeros(3), IMU_AT_Q) if declared.imu_position is None else (declared.imu_position, DRAWN)
            spread = covariance + self.lever.covariance + sigma_at**2 * np.eye(3)
            chi_square += self._distance(at + self.lever.r - r, spread)
        return chi_square

    def _distance(self, shift: Vector, covariance: Matrix) -> float:
        seen = shift - self.centre.undetermined @ shift
        return float(seen @ np.linalg.solve(covariance, seen))

    def distance(self, factor: float = 1.0) -> float:
        """Return the distance of the centre of gravity from Q, by this factor of every lever [m]."""
        return factor * float(np.linalg.norm(self.centre.r))

    def _unusual(self, factor: float, mass: float) -> float:
        """Chi-square of a lever that is unusual for a body of this mass."""
        usual = np.cbrt(mass / USUAL) / 2
        if self.distance(factor) > FARTHEST:
            return MOST_UNUSUAL
        decades = 3 * np.log10(max(self.distance(factor), 1e-3 * usual) / usual)
        return float(min(decades**2, MOST_UNUSUAL))

    def impossible(self, reading: UnitReading) -> bool:
        """Whether no body has, in these units, its mass with its moments, or levers."""
        mass = reading.force_factor * self.mass
        if self.trace is None:
            lever = self.distance(reading.lever_factor)
            longest = max(lever, reading.lever_factor * self.scatter)
            light = lever > FARTHEST and density(mass, 2 * mass * lever**2) < AIR
            return bool(light or longest < np.cbrt(mass / HEAVIEST) / 2 / BALANCED)
        trace, spread = self.trace
        smallest, largest = (reading.moment_factor * (trace + sign * CERTAIN * spread) for sign in (-1, 1))
        return bool(density(mass, smallest) < AIR or density(mass, largest) > HEAVIEST)


def body_of_run(
    sums: ConventionSums, given: Scales, mass: float, uncertainty: float, *, by_motion: bool
) -> BodyByWrench:
    """Return the body that a run's force and moment show.

    Args:
        sums: of the run.
        given: their scales.
        mass: whose weight the force is [kg].
        uncertainty: expanded uncertainty of the mass [kg].
        by_motion: whether the force's changes determine the mass, and so the lever.
    """
    lever = None
    if by_motion:
        priors = replace(given, offset=np.inf, lever=np.inf).priors
        fit = convention_fit.solve(sums, FORCE_TERMS, FORCE, variance=given.force, priors=priors)
        at, by_force = slice(MASS_AT.stop, MASS_AT.stop + 3), float(fit.values[0])
        lever = LeverByForce(fit.values[at] / by_force, fit.covariance[at, at] / by_force**2)
    trace = convention_fit.solve(sums, MOMENT_TERMS, MOMENT, variance=given.moment).trace
    return BodyByWrench(mass=mass, uncertainty=uncertainty, centre=sums.centre, lever=lever, trace=trace)


def other_units(body: BodyByWrench, declared: DeclaredRig, elsewhere: bool) -> list[UnitReading]:
    """Return the units that explain the run far better than those declared, the best first; none where none do.

    ``elsewhere``: another point does as well, with three free coordinates: a unit of the moment must do so entirely.
    """
    readings = list(unit_readings(*declared.units))
    scores = [body.misfit(reading, declared) for reading in readings]
    least = min(scores)
    rival = elsewhere and readings[scores.index(least)].force_factor == 1.0
    if not least < min(scores[0] - DECISIVE, EQUAL if rival else CONSISTENT):
        return []
    order = [k for k in np.argsort(scores) if scores[k] < least + EQUAL]
    return [readings[k] for k in order]

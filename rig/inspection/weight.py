"""Is the body's weight in the force? And if not: zeroed with the body on it, or taken off by the driver?"""

from dataclasses import dataclass

import numpy as np

from rig.inspection import mechanics
from rig.inspection.axes import DECISIVE, Scales, hypotheses
from rig.inspection.features import FORCE, MOMENT, SPECIFIC, Array, Features
from rig.inspection.mechanics import INERTIA_AT, MOMENT_TERMS, MOMENT_TERMS_WITH_WEIGHT, tensor

AIR = 1.0  # kg/m³: no body on a load cell is lighter
LEAST_PART = 0.3  # of the declared weight, below which it counts as missing
SURE = 6.0  # standard deviations
ZERO = 0.03  # of the mean force that may be the zero, as a standard deviation, besides a quarter of the noise
LIKENESS = 0.05  # of the force's changes: gravity carried along by a gyro is no better
LARGEST_ARM = 0.5  # metres from Q to the centre of gravity, as a standard deviation
LOADED = 'set zero = "loaded" in [recording]'
REMOVED = 'set compensated = "gravity" in [recording]'
REMOVED_FROM_FORCE = 'set compensated = "gravity_from_force" in [recording]'


@dataclass(frozen=True)
class Weight:
    """The mass that the mean force carries [kg], its uncertainty, and why the weight is missing, where it is."""

    mass: float
    uncertainty: float
    reason: str = ""

    @property
    def missing(self) -> bool:
        """Whether the mean force cannot be the body's weight."""
        return bool(self.reason)

    def density(self, sums: Features) -> float:
        """Mass over the cube of twice the gyration radius [kg/m³], with the least tensor that the moments allow."""
        trace = least_trace(sums)
        if trace <= 0:
            return np.inf
        mass = self.mass + self.uncertainty
        return float(mass / (2 * np.sqrt(trace / (2 * mass))) ** 3)

    def too_light(self, sums: Features) -> bool:
        """Whether a body of this mass and this tensor would be lighter than air."""
        return bool(self.density(sums) < AIR)

    def cure(self, sums: Features, given: Scales, body: "Body") -> str:
        """What was done to the force, as far as the run tells, and the line that undoes it."""
        changes = float(np.trace(sums.covariance(FORCE))) / 3
        variance = max(given.force, LIKENESS**2 * changes)
        terms = np.concatenate([mechanics.WEIGHT, mechanics.OFFSET])
        terms[0] += np.einsum("k,kij->ij", body.lever, mechanics.LEVER)
        loaded = mechanics.solve(sums, terms, FORCE, variance=variance)
        sure = mechanics.solve(sums, terms, FORCE, variance=given.force).significance(slice(0, 1))
        if loaded.values[0] <= 0 or sure < SURE:
            return f"removed by the driver? {_removed(sums, given, body)}"
        terms[0] += (mechanics.MOTION - mechanics.WEIGHT)[0]
        removed = mechanics.solve(sums, terms, FORCE, variance=variance)
        if removed.misfit - loaded.misfit > DECISIVE:
            return f"zeroed with the body on it? {LOADED}"
        if loaded.misfit - removed.misfit > DECISIVE:
            return f"removed by the driver? {_removed(sums, given, body)}"
        return f"zeroed with the body on it? {LOADED}; or removed by the driver? {_removed(sums, given, body)}"


@dataclass(frozen=True, eq=False)
class Body:
    """Declared mass [kg] and centre of gravity [m] from Q, or None; ``lever``: from the IMU to it [m]."""

    mass: float | None
    r_cg: Array | None
    lever: Array


def _removed(sums: Features, given: Scales, body: Body) -> str:
    """Whether the moment has the weight that the force has not: it turns with gravity as nothing else explains."""
    plain, weighed = (
        mechanics.solve(sums, terms, MOMENT, variance=given.moment)
        for terms in (MOMENT_TERMS, MOMENT_TERMS_WITH_WEIGHT)
    )
    if plain.misfit - weighed.misfit > DECISIVE:
        return REMOVED_FROM_FORCE
    if body.mass is not None and body.r_cg is not None:
        q, at = body.mass * body.r_cg, slice(len(MOMENT_TERMS), len(MOMENT_TERMS_WITH_WEIGHT))
        if float(q @ np.linalg.solve(weighed.covariance[at, at], q)) > DECISIVE:
            return REMOVED
    return f'{REMOVED}, or "gravity_from_force" where the moment still has it: this motion does not tell'


def weigh(sums: Features, declared: float | None) -> Weight:
    """Compare the mean force with the declared mass, or with the least mass that a body of such moments has."""
    gravity = float(np.linalg.norm(sums.mean(SPECIFIC)))
    if gravity < 1.0:
        return Weight(np.inf, 0.0)
    force = float(np.linalg.norm(sums.mean(FORCE)))
    weight = Weight(force / gravity, 4 * (sums.noise[0] / 4 + ZERO * force) / gravity)
    if declared is not None:
        if weight.mass + weight.uncertainty < LEAST_PART * declared and not _follows(sums, weight.mass):
            return Weight(weight.mass, weight.uncertainty, _reason(weight.mass, f"the declared {declared:.3g} kg"))
        return weight
    if weight.too_light(sums) and not _follows(sums, weight.mass):
        return Weight(weight.mass, weight.uncertainty, _reason(weight.mass, "a body with such moments"))
    return weight


def _reason(mass: float, whose: str) -> str:
    return f"the mean force is the weight of {mass:.2g} kg, far less than that of {whose}"


def _follows(sums: Features, mass: float) -> bool:
    """Whether the force points as the specific force does, in some order of the axes: a weight, if in another unit."""
    force, specific = sums.mean(FORCE), sums.mean(SPECIFIC)
    size = float(np.linalg.norm(force) * np.linalg.norm(specific))
    best = max(float(force @ one.matrix @ specific) for one in hypotheses()) / max(size, 1e-12)
    changes = float(np.sqrt(np.trace(sums.covariance(FORCE)) / max(np.trace(sums.covariance(SPECIFIC)), 1e-12)))
    return bool(best > np.cos(np.radians(4)) and changes < 4 * mass)


def least_trace(sums: Features) -> float:
    """The least trace of the tensor that the moments allow [kg·m²], over the axes under which they fit best."""
    tried = [one.applied(sums) for one in hypotheses()]
    left = [mechanics.variance_left(one, MOMENT_TERMS_WITH_WEIGHT, MOMENT) for one in tried]
    best = tried[int(np.argmin(left))]
    gravity = max(float(np.linalg.norm(sums.mean(SPECIFIC))), 1.0)
    heaviest = (float(np.linalg.norm(sums.mean(FORCE))) + 4 * sums.noise[0]) / gravity
    priors = np.concatenate([[LARGEST_ARM] * 3, [np.inf] * 9, [LARGEST_ARM * heaviest] * 3])
    fit = mechanics.solve(best, MOMENT_TERMS_WITH_WEIGHT, MOMENT, variance=min(left), priors=priors)
    spread = np.sqrt(max(float(fit.covariance[INERTIA_AT, INERTIA_AT][:3, :3].sum()), 0.0))
    return abs(float(np.trace(tensor(fit.values[INERTIA_AT])))) - SURE * spread

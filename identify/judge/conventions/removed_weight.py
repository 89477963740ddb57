"""Is the body's weight in the force? And if not: zeroed with the body on it, or removed by the driver?"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from identify.judge.conventions import convention_fit
from identify.judge.conventions.axis_hypotheses import DECISIVE, LARGEST_LEVER, Scales, hypotheses
from identify.judge.conventions.convention_fit import (
    ACCELERATION,
    COUNTERWEIGHT_AT,
    FORCE,
    FORCE_TERMS,
    LEVER,
    MOMENT,
    MOMENT_TERMS,
    MOMENT_TERMS_WITH_WEIGHT,
    NOT_RIGID,
    OFFSET,
    OFFSET_AT,
    SPECIFIC,
    WEIGHT,
    ConventionSums,
    DeclaredRig,
)

AIR = 1.0
"""Density below which no body on a load cell is [kg/m³].

Definition: that of air, 1.2 kg/m³, rounded down.
"""
LEAST_WEIGHT = 0.3
"""Lasting force over the declared weight, or specific force over gravity, below which there is no weight.

Choice: a zero or a wrong mass takes less than 70 % away. In 40 clean runs at least 0.98
(``tests.helpers.judge_margins``).
"""
CERTAIN = 6.0
"""Standard deviations from which a sign or a size is certain.

Chance: 2e-9 of a normal distribution.
"""
ZERO = 0.03
"""Part of the mean force that may be the zero, as a standard deviation, besides a quarter of the noise.

Prior: our choice, wide, so that a zero of the load cell is no evidence of anything else.
"""
LIKENESS = 0.05
"""Part of the force's changes that the fits leave at least.

Choice: gravity carried along by a gyro is no better.
"""
ALONG_GRAVITY = np.cos(np.radians(4.0))
"""Cosine between mean force and mean specific force from which the force points as gravity does.

Choice: 4°, as a mounting by eye and a moderate zero leave it; another order of axes is far off.
"""
MOST_CHANGES = 4.0
"""Changes of the force over those that the apparent mass would make, up to which it is a weight.

Choice: without the weight, what is left of the mean is a zero, far too small for the changes.
"""
ALIKE = 0.9
"""Correlation of the changes of force and specific force from which the force holds the weight.

Choice: without the weight it is half of that.
"""

MASS_OVER_SIGMA = 8.0
"""Mass by the force's changes, in standard deviations, from which they determine it.

Choice: the part that is missing is then good to an eighth.
"""
PARTLY = 0.5
"""Part of the weight that the force must lack throughout, beyond three standard deviations, to be named.

Choice: a load cell's zero is smaller.
"""

Removed = Literal["force", "force and moment", "undetermined"]
"""The signals from which the driver removed the weight."""


@dataclass(frozen=True)
class ApparentMass:
    """The mass whose weight the force is, with its uncertainty from zero and noise [kg]."""

    mass: float
    uncertainty: float
    missing: bool = False
    """Whether the force lacks the body's weight for certain."""


def density(mass: float, trace: float) -> float:
    """Return mass over the cube of twice the gyration radius ρ, ρ² = tr I / 2 m [kg/m³]; NaN of no positive trace."""
    return float(mass / (2 * np.sqrt(trace / (2 * mass))) ** 3) if trace > 0 else np.nan


class MassByMotion(NamedTuple):
    """Mass by which the force follows the specific force, the load cell's zero free."""

    mass: float
    """Mass in the unit of the force over m/s²."""
    sigma: float
    """Standard uncertainty of the mass."""
    missing: float
    """Part of its weight that the force lacks throughout; zero where gravity turns so far that no zero hides it."""


def mass_by_motion(sums: ConventionSums) -> MassByMotion | None:
    """Return the mass that the force's changes determine; None: they do not, or no body explains them."""
    variance = convention_fit.variance_left(sums, FORCE_TERMS, FORCE)
    fit = convention_fit.solve(sums, FORCE_TERMS, FORCE, variance=variance)
    mass, sigma, mean = float(fit.values[0]), float(np.sqrt(fit.covariance[0, 0])), sums.mean(SPECIFIC)
    if not mass > MASS_OVER_SIGMA * sigma or variance > NOT_RIGID**2 * sums.changes(FORCE):
        return None
    missing = 0.0 if sums.tilts else float(-fit.values[OFFSET_AT] @ mean / (mean @ mean)) / mass
    return MassByMotion(mass, sigma, missing)


@dataclass(frozen=True)
class MissingWeight:
    """The way in which the weight was removed, as far as the run shows: both may be possible."""

    zeroed: bool
    """Whether the load cell may have been zeroed with the body on it."""
    removed: Removed | None
    """Signals from which the driver may have removed the weight as it turned with gravity; None: it did not."""


def apparent_mass(sums: ConventionSums, declared: float | None) -> ApparentMass:
    """Compare the force with the declared mass, or with the least mass that a body of such moments has.

    The force's mean counts; where gravity turns all ways in the body, its changes, which no zero disturbs.
    """
    if sums.tilts:
        gravity, force = (float(np.sqrt(3 * sums.changes(columns))) for columns in (SPECIFIC, FORCE))
    else:
        gravity, force = (float(np.linalg.norm(sums.mean(columns))) for columns in (SPECIFIC, FORCE))
    if gravity < 1.0:
        return ApparentMass(np.inf, 0.0)
    mass, uncertainty = force / gravity, 4 * (sums.noise[0] / 4 + ZERO * force) / gravity
    if declared is None:
        light = density(mass + uncertainty, _least_trace(sums)) < AIR
    else:
        light = mass + uncertainty < LEAST_WEIGHT * declared
    return ApparentMass(mass, uncertainty, light and not _follows_gravity(sums, mass))


def missing_weight(sums: ConventionSums, given: Scales, declared: DeclaredRig) -> MissingWeight:
    """Whether what is left of the force turns with gravity (zeroed) or not (removed)."""
    variance = max(given.force, LIKENESS**2 * float(sums.changes(FORCE)))
    lever = np.einsum("k,kij->ij", declared.lever, LEVER)
    zeroed_terms = np.concatenate([WEIGHT + lever, OFFSET])
    zeroed = convention_fit.solve(sums, zeroed_terms, FORCE, variance=variance)
    significance = convention_fit.solve(sums, zeroed_terms, FORCE, variance=given.force).significance(slice(0, 1))
    removed_from = _removed_from(sums, given, declared)
    if zeroed.values[0] <= 0 or significance < CERTAIN:
        return MissingWeight(zeroed=False, removed=removed_from)
    removed = convention_fit.solve(sums, np.concatenate([ACCELERATION + lever, OFFSET]), FORCE, variance=variance)
    gain = float(removed.misfit - zeroed.misfit)
    return MissingWeight(zeroed=gain >= -DECISIVE, removed=removed_from if gain <= DECISIVE else None)


def _removed_from(sums: ConventionSums, given: Scales, declared: DeclaredRig) -> Removed:
    """Whether the moment has the weight that the force has not: it turns with gravity as nothing else explains."""
    plain, weighed = (
        convention_fit.solve(sums, terms, MOMENT, variance=given.moment)
        for terms in (MOMENT_TERMS, MOMENT_TERMS_WITH_WEIGHT)
    )
    if plain.misfit - weighed.misfit > DECISIVE:
        return "force"
    if declared.mass is not None and declared.r_cg is not None:
        q = declared.mass * declared.r_cg
        if float(q @ np.linalg.solve(weighed.covariance[COUNTERWEIGHT_AT, COUNTERWEIGHT_AT], q)) > DECISIVE:
            return "force and moment"
    return "undetermined"


def _follows_gravity(sums: ConventionSums, mass: float) -> bool:
    """Whether the force follows the specific force, in some order of the axes: a weight, if in another unit."""
    motions = filter(None, (mass_by_motion(hypothesis.applied(sums)) for hypothesis in hypotheses()))
    if any(abs(motion.missing) < PARTLY for motion in motions):
        return True
    if sums.tilts:
        return bool(max(_likeness(hypothesis.applied(sums)) for hypothesis in hypotheses()) > ALIKE)
    force, specific = sums.mean(FORCE), sums.mean(SPECIFIC)
    size = float(np.linalg.norm(force) * np.linalg.norm(specific))
    best = max(float(force @ hypothesis.matrix @ specific) for hypothesis in hypotheses()) / max(size, 1e-12)
    changes = float(np.sqrt(sums.changes(FORCE) / max(sums.changes(SPECIFIC), 1e-12)))
    return bool(best > ALONG_GRAVITY and changes < MOST_CHANGES * mass)


def _likeness(sums: ConventionSums) -> float:
    """Correlation of the changes of force and specific force."""
    together = float(np.trace(sums.gram[FORCE, SPECIFIC]) - sums.mean(FORCE) @ sums.mean(SPECIFIC))
    return together / max(3 * float(np.sqrt(sums.changes(FORCE) * sums.changes(SPECIFIC))), 1e-12)


def _least_trace(sums: ConventionSums) -> float:
    """The least trace of the tensor that the moments allow [kg·m²], over the axes under which they fit best."""
    candidates = [hypothesis.applied(sums) for hypothesis in hypotheses()]
    variances = [convention_fit.variance_left(turned, MOMENT_TERMS_WITH_WEIGHT, MOMENT) for turned in candidates]
    best = candidates[int(np.argmin(variances))]
    heaviest = (sums.size(FORCE) + 4 * sums.noise[0]) / max(sums.size(SPECIFIC), 1.0)
    priors = np.concatenate([[LARGEST_LEVER] * 3, [np.inf] * 9, [LARGEST_LEVER * heaviest] * 3])
    fit = convention_fit.solve(best, MOMENT_TERMS_WITH_WEIGHT, MOMENT, variance=min(variances), priors=priors)
    trace, spread = fit.trace
    return abs(trace) - CERTAIN * spread

"""Findings on static poses, by the weight alone: how their attitudes are to be read, axes and signs, units."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.estimation.static_poses.centre_result import Centre
from identify.estimation.static_poses.pose_fit import PoseSignals
from identify.judge.conventions.axis_hypotheses import DECISIVE, EQUAL
from identify.judge.conventions.convention_fit import (
    CONSTANT,
    FORCE,
    GRAVITY,
    MOMENT,
    SPECIFIC,
    WIDTH,
    CentreFit,
    ConventionSums,
    DeclaredRig,
    Vector,
)
from identify.judge.conventions.examined_run import ExaminedRun
from identify.judge.conventions.findings.attitude import AttitudeReadOtherwise
from identify.judge.conventions.findings.gravity import AXIS, along_axis, gravity_entry
from identify.judge.conventions.findings.mass import mass_finding
from identify.judge.conventions.findings.sign import SignReading
from identify.judge.conventions.findings.unit import units_finding
from identify.judge.conventions.gravity_findings import READINGS
from identify.judge.conventions.posed_force import PosedForce, PosedMotion, Rotations
from identify.judge.conventions.removed_weight import CERTAIN
from identify.judge.conventions.wrench_findings import findings_at_rest
from identify.judge.conventions.wrench_units import BodyByWrench, other_units
from identify.judge.cure import Entries
from identify.judge.findings import Finding
from identify.rigid_body.regressor import cross_matrices

CHANGE = 20.0
"""Chi-square that each further change of the declarations of static poses must gain.

Choice: more than ``EQUAL``, so that a reading with fewer changes has no rival with more.
"""


class PoseReading(NamedTuple):
    """One way to read the attitudes of static poses."""

    how: str
    """Words for it; empty: as declared."""
    settings: Sequence[Entries]
    """Keys that declare it; those of gravity, where it is unknown, are added."""
    to_rest: Rotations
    """Rotations from B to axes at rest."""
    at_rest: bool = False
    """Whether the wrench is along axes at rest."""
    gravity: Vector | None = None
    """Gravity along the axes at rest [m/s²]; None: unknown."""
    changes: int = 0
    """Number of declarations that it changes."""


def pose_findings(force: Float[np.ndarray, "n 3"], readings: Sequence[PoseReading], topic: str) -> list[Finding]:
    """Judge the forces of static poses by their attitudes.

    Args:
        force: recorded, on the body, along B or along axes at rest [N].
        readings: as declared, first, and others.
        topic: what messages call the poses.

    Returns:
        The finding, where another reading fits better than that declared.
    """
    posed = [_posed(force, reading) for reading in readings]
    fits = [poses.fit(lift=reading.gravity is None) for poses, reading in zip(posed, readings, strict=True)]
    declared = readings[0]
    assert declared.gravity is not None  # noqa: S101
    sensor = posed[0].fit(lift=False, turned=True)
    least = min((*fits, sensor), key=lambda fit: fit.misfit)
    if not posed[0].explained(least):
        return []
    scores = [
        posed[0].excess(fit, least) + CHANGE * reading.changes for fit, reading in zip(fits, readings, strict=True)
    ]
    turned = posed[0].excess(sensor, least) + CHANGE
    best = int(np.argmin(scores))
    if scores[0] < scores[best] + DECISIVE or turned < scores[best] - EQUAL:
        return []
    others = [k for k in np.argsort(scores) if scores[k] < scores[best] + EQUAL and not _same(posed[k], posed[best])]
    rivals = [readings[k].how for k in others] + [READINGS["sensor"]] * (turned < scores[best] + EQUAL)
    doubt = f"; or {' or '.join(rivals)}, which fits as well" if rivals else ""
    settings = [*readings[best].settings]
    down = -fits[best].lift / max(float(np.linalg.norm(fits[best].lift)), 1e-12)
    size = float(np.linalg.norm(declared.gravity))
    if readings[best].gravity is None:
        settings.append(gravity_entry(size * along_axis(down, AXIS)))
    return [AttitudeReadOtherwise(topic=topic, how=readings[best].how, doubt=doubt, settings=settings)]


def _same(first: PosedForce, second: PosedForce) -> bool:
    """Whether two readings mean the same: the same force in B, and the same weight."""
    if first is second:
        return True
    if not np.allclose(first.force, second.force):
        return False
    one, other = first.motion, second.motion
    if one.specific is None or other.specific is None:
        return one.specific is other.specific and bool(np.allclose(one.to_rest, other.to_rest, atol=1e-6))
    return bool(np.allclose(one.specific, other.specific, atol=1e-6))


def _posed(force: np.ndarray, reading: PoseReading) -> PosedForce:
    along = force if not reading.at_rest else np.einsum("nji,nj->ni", reading.to_rest, force)
    if reading.gravity is None:
        return PosedForce(along, PosedMotion(reading.to_rest))
    specific = -np.einsum("nji,j->ni", reading.to_rest, reading.gravity)
    return PosedForce(along, PosedMotion(reading.to_rest, specific))


FEWEST = 6
"""Choice: poses from which axes are judged; of fewer, three numbers of a rotation imitate noise."""


def axis_findings(signals: PoseSignals, declared: DeclaredRig, upside_down: SignReading, topic: str) -> list[Finding]:
    """Judge axes and signs of the load cell against those of the attitude, as those of a run.

    Args:
        signals: of the poses, in B as far as declared.
        declared: of body and rig.
        upside_down: words and cure where the attitude has the other sign.
        topic: what messages call the poses.
    """
    if len(signals.force) < FEWEST:
        return []
    return list(findings_at_rest(ExaminedRun(_sums(signals), declared, topic, topic, at_rest=True), upside_down))


def _sums(signals: PoseSignals) -> ConventionSums:
    """The sums of poses, without motion; the moment's zero, which may be large, is taken off by ``M = r × F + M0``."""
    force, moment, specific = signals
    rows = np.concatenate([-cross_matrices(force), np.broadcast_to(np.eye(3), (len(force), 3, 3))], axis=2)
    fitted = np.linalg.lstsq(rows.reshape(-1, 6), moment.reshape(-1), rcond=None)[0]
    columns = np.zeros((WIDTH, len(force)))
    columns[FORCE], columns[MOMENT] = force.T, (moment - fitted[3:]).T
    columns[SPECIFIC] = columns[GRAVITY] = specific.T
    columns[CONSTANT] = 1.0
    return ConventionSums(columns @ columns.T / len(force), float(len(force)))


def unit_findings(centre: Centre, declared: DeclaredRig, topic: str) -> list[Finding]:
    """Judge the units of static poses by mass, lever and density, as those of a run.

    Args:
        centre: as the poses show it.
        declared: mass and units; the declared centre of gravity does not count, which poses are to measure.
        topic: what messages call the poses.
    """
    place = CentreFit(centre.r_cg, centre.covariance[1:4, 1:4], np.zeros((3, 3)))
    mass, sigma, gain = centre.mass, float(np.sqrt(centre.covariance[0, 0])), centre.gain
    if gain is not None:  # the centre's mass is the scale's where the load cell's contradicts it
        mass, sigma = gain.ratio * gain.mass, gain.ratio_standard_uncertainty * gain.mass
    force, moment = centre.residual
    scatter = moment / max(force, 1e-12 * mass)
    body = BodyByWrench(mass=mass, uncertainty=CERTAIN * sigma, centre=place, scatter=scatter)
    readings = other_units(body, replace(declared, r_cg=None), elsewhere=False)
    if readings:
        return [units_finding(body, readings, [], topic)]
    return list(mass_finding(mass, CERTAIN * sigma, declared.mass if gain is None else None, topic))

"""Findings on the attitudes of static poses, by the weight alone: which way to read them fits the forces."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.axis_hypotheses import DECISIVE, EQUAL
from identify.judge.conventions.convention_fit import Vector
from identify.judge.conventions.gravity_findings import AXIS, READINGS, PosedForce, Rotations, along_axis, gravity_text
from identify.judge.findings import Contradiction, Finding

CHANGE = 20.0
"""Chi-square that each further change of the declarations of static poses must gain.

Choice: more than ``EQUAL``, so that a reading with fewer changes has no rival with more.
"""


class PoseReading(NamedTuple):
    """One way to read the attitudes of static poses."""

    how: str
    """Words for it; empty: as declared."""
    cure: str
    """Line or lines that declare it."""
    to_rest: Rotations
    """Rotations from B to axes at rest."""
    at_rest: bool = False
    """Whether the wrench is along axes at rest."""
    gravity: Vector | None = None
    """Gravity along the axes at rest [m/s²]; None: unknown."""
    changes: int = 0
    """Number of declarations that it changes."""


def pose_findings(force: Float[np.ndarray, "n 3"], readings: Sequence[PoseReading], topic: str) -> list[Contradiction]:
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
    if scores[0] < scores[best] + DECISIVE:
        upside_down = fits[0].mass < 0 and posed[0].explained(fits[0])
        cure = gravity_text(-declared.gravity)
        return [Finding.POSES_UPSIDE_DOWN.on(topic, gravity=cure)] if upside_down else []
    if turned < scores[best] - EQUAL:
        return []
    others = [k for k in np.argsort(scores) if scores[k] < scores[best] + EQUAL and not _same(posed[k], posed[best])]
    rivals = [readings[k].how for k in others] + [READINGS["sensor"]] * (turned < scores[best] + EQUAL)
    doubt = f"; or {' or '.join(rivals)}, which fits as well" if rivals else ""
    lines = readings[best].cure
    down = -fits[best].lift / max(float(np.linalg.norm(fits[best].lift)), 1e-12)
    size = float(np.linalg.norm(declared.gravity))
    lines = lines.replace("{gravity}", gravity_text(size * along_axis(down, AXIS)))
    return [Finding.ATTITUDE_READ_OTHERWISE.on(topic, how=readings[best].how, doubt=doubt, lines=lines)]


def _same(first: PosedForce, second: PosedForce) -> bool:
    """Whether two readings mean the same: the same force in B, and the same weight."""
    if first is second:
        return True
    if not np.allclose(first.force, second.force):
        return False
    if first.specific is None or second.specific is None:
        return first.specific is second.specific and bool(np.allclose(first.to_rest, second.to_rest, atol=1e-6))
    return bool(np.allclose(first.specific, second.specific, atol=1e-6))


def _posed(force: np.ndarray, reading: PoseReading) -> PosedForce:
    along = force if not reading.at_rest else np.einsum("nji,nj->ni", reading.to_rest, force)
    if reading.gravity is None:
        return PosedForce(along, reading.to_rest)
    return PosedForce(along, reading.to_rest, specific=-np.einsum("nji,j->ni", reading.to_rest, reading.gravity))

"""A load cell's constant offsets: what the data tell of them, with what uncertainty.

Equation (5) sees ``M - r × F``, so of six constants it tells three: the moment's offset less ``r ×`` the force's. They
come out of the regression along with the tensor, or out of the body's rest, where ``M - r × F`` is zero whatever the
attitude. Mass and an accelerometer tell the force's offset too, ``F - m f``, and with it the moment's about Q.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.rigid_body.regressor import cross_matrix
from identify.signals.run import Rest, Run, RunError
from identify.signals.segments import Segment

BLOCK = 1.0
"""Seconds of rest whose means count as independent."""


class Offsets(NamedTuple):
    """A load cell's constants as (5) sees them: a constant force acts only through its moment about the CG."""

    moment: np.ndarray
    """Constant part of ``M - r × F`` [N·m]: the moment's offset less ``r ×`` the force's."""
    covariance: np.ndarray
    """Covariance of ``moment`` from noise, (3, 3) [(N·m)²], to which the uncertainty of r adds."""
    force: np.ndarray
    """Mean force that went with it [N], through which r acts on it."""


def rested(rest: Rest, r_cg: np.ndarray) -> Offsets:
    """Return the offset from rest, where ``M - r × F`` is zero whatever the attitude."""
    about_cg = np.hstack([-cross_matrix(np.asarray(r_cg)), np.eye(3)])
    return Offsets(rest.moment - np.cross(r_cg, rest.force), about_cg @ rest.covariance @ about_cg.T, rest.force)


def resting(run: Run) -> Rest:
    """Return what the load cell reads at rest.

    Raises:
        RunError: the run holds none.
    """
    if run.rest is None:
        raise RunError(
            f"{run.name} has no rest to take the offsets from: record a second of it before or after the motion, or "
            "have them estimated"
        )
    return run.rest


def rest_of(run: Run, segments: Sequence[Segment]) -> Rest | None:
    """Return what the load cell reads over some segments of rest of a run; None: fewer than two seconds of it.

    The covariance comes from the scatter of the means of one second each, which holds noise and slow drift.
    """
    size = max(round(BLOCK * run.rate), 1)
    means: list[np.ndarray] = []
    wrench = np.hstack([run.force, run.moment])
    usable = run.usable
    for segment in segments:
        first, last = np.searchsorted(run.t - run.t[0], [segment.start, segment.stop + 0.5 / run.rate])
        blocks = [slice(k, k + size) for k in range(int(first), int(last) - size + 1, size)]
        means += [wrench[block].mean(axis=0) for block in blocks if usable[block].all()]
    if len(means) < 2:
        return None
    mean = np.mean(means, axis=0)
    free = max(len(means) - 1, 1)
    covariance = np.einsum("ni,nj->ij", means - mean, means - mean) / free / len(means)
    return Rest(mean[:3], mean[3:], covariance, len(means) * BLOCK)


def force_offset(run: Run, r_cg: np.ndarray, mass: float | None) -> np.ndarray | None:
    """Return the mean of ``F - m f`` [N], f the specific force at the centre of gravity; None: one of them is missing.

    An offset of the accelerometer counts times the mass.
    """
    if mass is None or run.specific_force is None:
        return None
    residual_force = run.force - mass * run.specific_force_at(r_cg)
    return np.concatenate([residual_force[segment] for segment in run.used()]).mean(axis=0)


def uncertainty(offsets: Offsets, sigma_r_cg: np.ndarray) -> np.ndarray:
    """Return the standard uncertainty of ``M - r × F``'s constant on each axis [N·m]: noise, and that of r."""
    centre_effects = cross_matrix(np.asarray(offsets.force)) * sigma_r_cg
    return np.sqrt(np.diag(offsets.covariance) + (centre_effects**2).sum(axis=1))

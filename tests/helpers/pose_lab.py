"""Static poses of one body, again and again: what the intervals of the ten parameters hold."""

import numpy as np
from scipy.spatial.transform import Rotation

from identify.static.centre import centre
from identify.static.pose_fit import Attitudes

GRAVITY = 9.81
MASS, R_CG = 3.7, np.array([0.013, -0.027, 0.081])
FORCE_OFFSET, MOMENT_OFFSET = np.array([4.0, -7.0, 2.5]), np.array([0.3, -0.1, 0.7])
TRUTH = np.concatenate([[MASS], R_CG, FORCE_OFFSET, MOMENT_OFFSET])
UNEVEN = np.diag([3, 1, 1.2, 1, 2, 0.5]) @ np.linalg.cholesky(0.5 * np.eye(6) + 0.5)
"""Noise that differs from axis to axis and is correlated across force and moment, as a real load cell's residuals."""


def directions(rng, poses, tilt):
    """Specific forces: turned all ways, or a platform's tilt [rad] about two axes."""
    if tilt is None:
        return GRAVITY * Rotation.random(poses, rng=rng).as_matrix()[:, 2]
    return GRAVITY * Rotation.from_euler("xy", rng.uniform(-tilt, tilt, (poses, 2))).as_matrix()[:, 2]


def wrench_of(f):
    return MASS * f + FORCE_OFFSET, np.cross(R_CG, MASS * f) + MOMENT_OFFSET


def series(rng, *, poses=12, tilt=None, mixed=None, each=0.0, alignment=0.0, scale=None):
    """One series of poses with errors, and what :func:`centre` makes of it."""
    f = directions(rng, poses, tilt)
    root = np.diag([0.2] * 3 + [0.005] * 3) @ (np.eye(6) if mixed is None else mixed)
    force, moment = wrench_of(f)
    noise = rng.normal(size=(poses, 6)) @ root.T
    seen = f + np.cross(each * rng.normal(size=f.shape) + alignment * rng.normal(size=3), f)
    axes = np.broadcast_to(alignment * np.eye(3), (poses, 3, 3))
    common = np.cross(axes, seen[:, None], axis=2).transpose(0, 2, 1) if alignment else None
    mass = None if scale is None else (MASS + scale * rng.normal(), scale)
    attitudes = Attitudes(each, common)
    return centre(force + noise[:, :3], moment + noise[:, 3:], seen, attitudes=attitudes, mass=mass)


CASES = {
    "all ways": {},
    "uneven noise": {"mixed": UNEVEN},
    "limited tilt": {"tilt": 0.35},
    "limited tilt, uneven noise": {"tilt": 0.35, "mixed": UNEVEN},
    "attitudes": {"tilt": 0.35, "each": 3e-3},
    "alignment": {"tilt": 0.35, "alignment": 5e-3},
    "alignment, all ways": {"alignment": 1e-2, "poses": 24},
    "scale": {"tilt": 0.35, "scale": 2e-3},
}


def coverage(case, repeats):
    """In how many of the repeats each of the ten intervals of 95 % holds the truth."""
    rng = np.random.default_rng(5)
    inside = np.zeros(10)
    for _ in range(repeats):
        low, high = series(rng, **CASES[case]).interval95.T
        inside += (low <= TRUTH) & (high >= TRUTH)
    return inside / repeats

"""Static poses of one body, again and again: what the intervals of the ten parameters hold."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.pose_fit import Attitudes

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


NOISE = np.array([0.2] * 3 + [0.005] * 3)
Wrong = Callable[[np.ndarray, np.random.Generator], np.ndarray]
"""Function from the wrench (n, 6) to what the load cell reads of it before its noise."""


class Kind(NamedTuple):
    """A kind of set: what is wrong with it, and of what poses it is."""

    wrong: Wrong = lambda wrench, _: wrench
    poses: int = 24
    tilt: float | None = None
    each: float = 0.0
    """Standard uncertainty of each attitude [rad], declared."""
    mixed: np.ndarray | None = None
    """Factor of the noise, which mixes the axes."""
    name: str | None = None
    """Word of the warning that is right."""


def knocked(count: int = 1, size: float = 6.0) -> Wrong:
    """Some poses are read while a hand pushes by so many N along one axis."""

    def wrong(wrench: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        off = np.zeros_like(wrench)
        off[rng.choice(len(wrench), count, replace=False), rng.integers(3, size=count)] = size
        return wrench + off

    return wrong


def lagging(part: float, memory: float = 0.0) -> Wrong:
    """A part of the load follows late: it is that of the pose before, or a mean of all before that forgets."""

    def wrong(wrench: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        late, held = np.empty_like(wrench), wrench[rng.integers(len(wrench))]
        for row, now in zip(late, wrench, strict=True):
            row[:], held = held, memory * held + (1 - memory) * now
        return wrench + part * (late - wrench)

    return wrong


def hysteretic(part: float) -> Wrong:
    """Each axis reads less by a part of its range after it rose, more after it fell."""

    def wrong(wrench: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        before = np.vstack([wrench[rng.integers(len(wrench))], wrench[:-1]])
        return wrench - part * np.ptp(wrench, axis=0) / 2 * np.sign(wrench - before)

    return wrong


KINDS = {
    "clean, 8 poses": Kind(poses=8),
    "clean, 12 poses, tilted by 20°": Kind(poses=12, tilt=0.35),
    "clean, 24 poses": Kind(),
    "clean, 24 poses, uneven noise": Kind(mixed=UNEVEN),
    "clean, 24 poses, attitudes by 3 mrad": Kind(each=3e-3),
    "knock of 6 N": Kind(knocked(), name="contradicts"),
    "knock of 2 N": Kind(knocked(size=2.0), name="contradicts"),
    "three knocks of 6 N": Kind(knocked(3), name="contradicts"),
    "creep of 0.3 %": Kind(lagging(0.003), name="lag"),
    "creep of 1 %": Kind(lagging(0.01), name="lag"),
    "creep of 3 %": Kind(lagging(0.03), name="lag"),
    "creep of 1 % over several poses": Kind(lagging(0.01, memory=0.5), name="lag"),
    "hysteresis of 1 %": Kind(hysteretic(0.01), name="lag"),
}


def signals(kind: Kind, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force, moment and specific force of one set."""
    f = directions(rng, kind.poses, kind.tilt)
    noise = rng.normal(size=(kind.poses, 6)) * NOISE
    read = kind.wrong(np.hstack(wrench_of(f)), rng) + (noise if kind.mixed is None else noise @ kind.mixed.T)
    return read[:, :3], read[:, 3:], f + np.cross(kind.each * rng.normal(size=f.shape), f)


def log(generator, *, rate=125.0, noise=0.0, stops=6, hold=1):
    """Upward directions of a body that turns from stop to stop in a second each, with noise of the attitude [rad]."""
    aims = Rotation.random(stops, rng=generator)
    part = np.linspace(0, 1, round(rate), endpoint=False)
    smooth = part - np.sin(2 * np.pi * part) / (2 * np.pi)
    turns = [
        here * Rotation.from_rotvec(np.outer(smooth, (here.inv() * there).as_rotvec()))
        for here, there in pairwise(aims)
    ]
    held = [np.tile(aim.as_matrix()[2], (hold * round(rate), 1)) for aim in aims]
    parts = [rows for pair in zip(held, (turn.as_matrix()[:, 2] for turn in turns), strict=False) for rows in pair]
    up = np.vstack([*parts, held[-1]])
    return up + noise * generator.normal(size=up.shape)

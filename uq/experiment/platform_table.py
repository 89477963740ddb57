"""``[platform] geometry`` and ``[platform.limits]`` of an experiment file -> a platform with legs, and its limits."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from identify.motion.leg_limits import Limits
from identify.motion.stewart_platform import Platform, Rod
from identify.rigid_body.inertia import Body
from uq.files.document import ExperimentError, Table

GEOMETRIES = ("assumed-source-size", "linuxcnc-genhexkins", "simscape-demonstration")
"""Platforms that are installed with the package."""
NONE = {"mass": "0 kg"}


@dataclass(frozen=True, eq=False)
class DeclaredLimits:
    """What a rig can do, as declared: figures, and the trajectory whose needs stand where the legs have none."""

    figures: Limits
    trajectory: str | None
    """Name of the trajectory whose needs limit the legs; None: the figures alone do."""


def parse_geometry(table: Table) -> Platform | None:
    """Return the platform that ``geometry`` of the table ``[platform]`` names or describes; None: it has none.

    Raises:
        ExperimentError: an unknown name or key, or a value that it cannot have.
    """
    raw = table.raw("geometry", None)
    if raw is None:
        return None
    if isinstance(raw, str):
        name = table.choice("geometry", GEOMETRIES)
        text = resources.files("uq").joinpath("presets", "platforms", f"{name}.toml").read_text("utf-8")
        return _platform(Table("geometry", tomllib.loads(text)))
    return table.table("geometry", _platform)


def _platform(table: Table) -> Platform:
    table.typed("reference", str, "")
    base, joints = _points(table, "base"), _points(table, "joints", shifted=True)
    platform = Platform(
        np.asarray(base),
        np.asarray(joints),
        np.asarray(table.vector("home", "m")),
        table.table("plate", _plate, NONE),
        table.table("cylinder", _rod, NONE),
        table.table("rod", _rod, NONE),
    )
    table.finish()
    return platform


def _points(table: Table, key: str, *, shifted: bool = False) -> np.ndarray:
    """Six points: listed, or in three pairs on a circle, counter-clockwise.

    The legs part from each pair of the base to the two neighbouring pairs of the platform.
    """
    raw = table.raw(key)
    if not isinstance(raw, Mapping):
        return _listed(table, key, raw)
    radius, half, first, height = table.table(key, _ring)
    angles = first + np.radians(120) * np.repeat(np.arange(3), 2) + half * np.tile([-1.0, 1.0], 3)
    ring = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(6, height)], axis=1)
    return np.roll(ring, 1, axis=0) if shifted else ring


def _listed(table: Table, key: str, raw: Any) -> np.ndarray:
    if not isinstance(raw, list) or len(raw) != 6:
        raise ExperimentError(f"{table.path(key)} is {raw!r}: write six points, one a leg, or a circle of three pairs")
    return np.array([Table(f"{table.path(key)}[{k}]", {"at": point}).vector("at", "m") for k, point in enumerate(raw)])


def _ring(table: Table) -> tuple[float, float, float, float]:
    found = (
        table.quantity("radius", "m", positive=True),
        table.quantity("half_angle", "rad", positive=True),
        table.quantity("first", "rad", 0.0),
        table.quantity("height", "m", 0.0),
    )
    table.finish()
    return found


def _plate(table: Table) -> Body:
    mass = table.quantity("mass", "kg")
    centre = table.vector("r_cg_from_omb", "m", ["0 m"] * 3)
    moments = table.raw("inertia", None)
    inertia = np.zeros(6) if moments is None else table.table("inertia", _tensor)
    table.finish()
    parts: Any = (np.asarray(_not_negative(table, mass)), centre, inertia)
    return Body(*parts)


def _tensor(table: Table) -> np.ndarray:
    names = ("I11", "I12", "I13", "I22", "I23", "I33")
    packed = np.array([table.quantity(name, "kg*m^2", 0.0) for name in names])
    table.finish()
    return packed


def _rod(table: Table) -> Rod:
    mass = table.quantity("mass", "kg")
    distance, inertia = table.quantity("distance", "m", 0.0), table.quantity("inertia", "kg*m^2", 0.0)
    table.finish()
    parts: Any = [np.asarray(_not_negative(table, value)) for value in (mass, distance, inertia)]
    return Rod(*parts)


def _not_negative(table: Table, value: float) -> float:
    if value < 0:
        raise ExperimentError(f"{table.where} holds a value below zero: masses, distances and moments are not")
    return value


def parse_limits(table: Table) -> DeclaredLimits:
    """Return the table ``[platform.limits]``.

    Raises:
        ExperimentError: an unknown key, or a value that it cannot have.
    """
    free = Limits.none()
    legs = {"speed": "m/s", "acceleration": "m/s^2", "force": "N"}
    single = {"joint_angle": "rad", "gyro_range": "rad/s", "body_acceleration": "m/s^2"}
    figures = free._replace(
        length=_ends(table),
        **{key: np.full(6, table.quantity(key, unit, np.inf, positive=True)) for key, unit in legs.items()},
        **{key: np.array(table.quantity(key, unit, np.inf, positive=True)) for key, unit in single.items()},
        **{key: _rated(table, key, unit) for key, unit in (("cell_force", "N"), ("cell_moment", "N*m"))},
        bandwidth=table.quantity("bandwidth", "Hz", np.inf, positive=True),
    )
    trajectory = table.typed("needs_of", str, None)
    table.finish()
    return DeclaredLimits(figures, trajectory)


def _ends(table: Table) -> np.ndarray:
    raw = table.raw("length", None)
    if raw is None:
        return Limits.none().length
    if not isinstance(raw, list) or len(raw) != 2:
        raise ExperimentError(f"{table.path('length')} is {raw!r}: write the shortest and the longest")
    ends = Table(table.path("length"), {"shortest": raw[0], "longest": raw[1]})
    low, high = ends.quantity("shortest", "m", positive=True), ends.quantity("longest", "m", positive=True)
    if low >= high:
        raise ExperimentError(f"{table.path('length')} is {raw!r}: write the shortest first")
    return np.tile([low, high], (6, 1))


def _rated(table: Table, key: str, unit: str) -> np.ndarray:
    if key not in table.content:
        return np.full(3, np.inf)
    values = table.vector(key, unit)
    if (values <= 0).any():
        raise ExperimentError(f"{table.path(key)} is {table.content[key]!r}: write values above zero")
    return values

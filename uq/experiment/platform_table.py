"""``[platform]`` of an experiment file: gravity, the platform's legs and the rig's limits."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from importlib import resources
from typing import Annotated, Any, Literal, get_args

import numpy as np

from identify.motion.leg_limits import Limits
from identify.motion.stewart_platform import Rod, StewartPlatform
from identify.rigid_body.gravity import STANDARD_GRAVITY, normal_gravity
from identify.rigid_body.inertia import Body
from rig.exceptions import quoted
from rig.toml_tables import TomlTable, WrongKeyError, read_table, read_value, written
from uq.experiment.arm_table import ArmKeys
from uq.files.schema import Axes, Component, declared_table, in_unit, interval, vector, vector_schema

Geometry = Literal["assumed-source-size", "linuxcnc-genhexkins", "simscape-demonstration"]
GEOMETRIES: tuple[str, ...] = get_args(Geometry)
"""Platforms that are installed with the package."""
HIGHEST = 10_000.0
"""Height [m] beyond which no laboratory stands."""
Metre = Annotated[float, in_unit("m")]


@dataclass(frozen=True, eq=False)
class DeclaredLimits:
    """Declared limits of a rig: figures, and the trajectory whose needs replace missing limits of the legs."""

    figures: Limits
    trajectory: str | None
    """Name of the trajectory whose needs limit the legs; None: the figures alone do."""


class Place(TomlTable, frozen=True, kw_only=True):
    """Location of the platform, from which local gravity is computed."""

    latitude: Annotated[float, in_unit("rad")]
    """Geographic latitude of the platform."""
    height: Metre = 0.0
    """Height above the ellipsoid."""

    def __post_init__(self) -> None:
        """Refuse what is not on the earth."""
        if abs(self.latitude) > math.pi / 2:
            raise WrongKeyError("latitude", "write -90 deg to 90 deg")
        if abs(self.height) > HIGHEST:
            raise WrongKeyError("height", "write a height on the earth")


class Ring(TomlTable, frozen=True, kw_only=True):
    """Six points in three pairs on a circle, counter-clockwise."""

    radius: Annotated[float, in_unit("m", above=0)]
    """Radius of the circle."""
    half_angle: Annotated[float, in_unit("rad", above=0)]
    """Half of the angle between the points of a pair, as seen from the circle's centre."""
    first: Annotated[float, in_unit("rad")] = 0.0
    """Direction of the first pair's middle from the circle's centre."""
    height: Metre = 0.0
    """Height of the circle's plane."""

    @property
    def points(self) -> np.ndarray:
        """Positions of the six points [m], (6, 3)."""
        angles = self.first + np.radians(120) * np.repeat(np.arange(3), 2) + self.half_angle * np.tile([-1.0, 1.0], 3)
        height = np.full(6, self.height)
        return np.stack([self.radius * np.cos(angles), self.radius * np.sin(angles), height], axis=1)


def _points(path: str, raw: Any, *, shifted: bool = False) -> np.ndarray:
    """Six points: listed, or in three pairs on a circle.

    The legs part from each pair of the base to the two neighbouring pairs of the platform.
    """
    if isinstance(raw, Mapping):
        ring = read_table(path, raw, Ring).points
        return np.roll(ring, 1, axis=0) if shifted else ring
    if not isinstance(raw, list) or len(raw) != 6:
        raise ValueError(f"is {quoted(raw)}: write six points, one per leg, or a circle of three pairs")
    return np.array(read_value(path, raw, tuple[Axes[Metre], ...]))


POINTS = {
    "anyOf": [{"type": "array", "items": vector_schema("m"), "minItems": 6, "maxItems": 6}, {"$ref": "#/$defs/Ring"}]
}


class Plate(TomlTable, frozen=True, kw_only=True):
    """The platform's plate."""

    mass: Annotated[float, in_unit("kg", least=0)]
    r_cg_from_omb: Axes[Metre] = (0.0, 0.0, 0.0)
    """Centre of gravity of the plate from the platform's centre."""
    inertia: Mapping[Component, Annotated[float, in_unit("kg*m^2")]] | None = None
    """Tensor of the plate about its centre of gravity; entries that are not stated are zero."""

    @property
    def body(self) -> Body:
        """Mass, centre of gravity and tensor, in SI."""
        packed = [(self.inertia or {}).get(name, 0.0) for name in get_args(Component)]
        parts: Any = (np.asarray(self.mass), np.array(self.r_cg_from_omb), np.array(packed))
        return Body(*parts)


class RodTable(TomlTable, frozen=True, kw_only=True):
    """A leg's cylinder or rod."""

    mass: Annotated[float, in_unit("kg", least=0)]
    distance: Annotated[float, in_unit("m", least=0)] = 0.0
    """Distance of the centre of gravity from the joint, along the leg."""
    inertia: Annotated[float, in_unit("kg*m^2", least=0)] = 0.0
    """Moment of inertia about the centre of gravity, across the leg's axis."""

    @property
    def rod(self) -> Rod:
        """The part of the leg in SI."""
        parts: Any = [np.asarray(value) for value in (self.mass, self.distance, self.inertia)]
        return Rod(*parts)


class GeometryTable(TomlTable, frozen=True, kw_only=True):
    """A platform on six legs."""

    reference: str = ""
    """Publication or document from which the figures come."""
    base: Annotated[np.ndarray, written(_points, POINTS)]
    """Joints on the base: six points, one per leg, or three pairs on a circle."""
    joints: Annotated[np.ndarray, written(partial(_points, shifted=True), POINTS)]
    """Joints on the platform, from its centre."""
    home: Annotated[np.ndarray, vector("m")]
    """The platform's centre at home, from the base's."""
    plate: Plate = Plate(mass=0.0)
    cylinder: RodTable = RodTable(mass=0.0)
    """The part of each leg that hangs on the base."""
    rod: RodTable = RodTable(mass=0.0)
    """The part of each leg that hangs on the platform."""

    @property
    def platform(self) -> StewartPlatform:
        """The platform in SI."""
        return StewartPlatform(
            base=self.base, joints=self.joints, home=self.home, plate=self.plate.body, cylinder=self.cylinder.rod,
            rod=self.rod.rod,
        )  # fmt: skip


OF_LEGS = ("length", "speed", "acceleration", "force", "joint_angle", "needs_of")
"""Limits that legs have and an arm has not."""


class LimitsTable(TomlTable, frozen=True, kw_only=True):
    """``[platform.limits]``: limits of the rig; missing: no limit."""

    length: Annotated[tuple[float, float], interval("m", above=0)] | None = None
    """Shortest and longest length of a leg."""
    speed: Annotated[float, in_unit("m/s", above=0)] = np.inf
    """Largest speed of a leg, either way."""
    acceleration: Annotated[float, in_unit("m/s^2", above=0)] = np.inf
    """Largest acceleration of a leg, either way."""
    force: Annotated[float, in_unit("N", above=0)] = np.inf
    """Largest force along a leg, either way."""
    joint_angle: Annotated[float, in_unit("rad", above=0)] = np.inf
    """Largest angle of a leg from its joint's axis."""
    gyro_range: Annotated[float, in_unit("rad/s", above=0)] = np.inf
    """Largest angular velocity on each axis of the gyro."""
    body_acceleration: Annotated[float, in_unit("m/s^2", above=0)] = np.inf
    """Largest acceleration of the body's centre of gravity."""
    cell_force: Axes[Annotated[float, in_unit("N", above=0)]] = (np.inf, np.inf, np.inf)
    """Rated force of the load cell on each axis."""
    cell_moment: Axes[Annotated[float, in_unit("N*m", above=0)]] = (np.inf, np.inf, np.inf)
    """Rated moment of the load cell on each axis."""
    bandwidth: Annotated[float, in_unit("Hz", above=0)] = np.inf
    """Highest frequency of the command."""
    needs_of: str | None = None
    """Name of the trajectory whose needs limit the legs where their own limits are not stated."""

    @property
    def limits(self) -> DeclaredLimits:
        """The limits in SI, leg by leg."""
        leg = {key: np.full(6, getattr(self, key)) for key in ("speed", "acceleration", "force")}
        others = ("joint_angle", "gyro_range", "body_acceleration", "cell_force", "cell_moment")
        rig = {key: np.array(getattr(self, key)) for key in others}
        length = Limits.none().length if self.length is None else np.tile(self.length, (6, 1))
        figures = Limits.none()._replace(length=length, bandwidth=self.bandwidth, **leg, **rig)
        return DeclaredLimits(figures, self.needs_of)


class PlatformTable(ArmKeys, frozen=True, kw_only=True):
    """``[platform]``: the platform, or the robot arm, that carries the body."""

    kind: Literal["legs", "arm"] = "legs"
    """Kind of the platform: six legs, or a robot arm."""
    gravity: Annotated[float, in_unit("m/s^2", above=0)] | Place = STANDARD_GRAVITY
    """Local gravity: its value, or the latitude and height of the place; missing: standard gravity."""
    r_cg_from_omb: Annotated[np.ndarray, vector("m")] | None = None
    """Centre of gravity from the platform's centre, in B; missing: at the platform's centre."""
    geometry: Geometry | GeometryTable | None = None
    """The platform's six legs: the name of a platform of the package, or a description."""
    limits: LimitsTable | None = None
    """Limits of the rig."""

    def __post_init__(self) -> None:
        """Refuse the keys of an arm for legs, and those of legs for an arm."""
        self.check_arm(self.kind == "arm")
        if self.kind == "arm":
            for key in ("geometry", "r_cg_from_omb"):
                if getattr(self, key) is not None:
                    raise WrongKeyError(key, "remove it", "is for a platform on six legs, not for an arm")
            stated = {} if self.limits is None else self.limits.to_dict()
            free = LimitsTable().to_dict()
            for key in OF_LEGS:
                if key in stated and stated[key] != free[key]:
                    raise WrongKeyError("limits", "state limits of joints in [[platform.joint]]", f"has {key} of legs")

    @property
    def local_gravity(self) -> float:
        """Local gravity of the platform [m/s²]."""
        place = self.gravity
        return normal_gravity(place.latitude, place.height) if isinstance(place, Place) else place

    @property
    def legs(self) -> StewartPlatform | None:
        """The platform's six legs; None: not stated."""
        if self.geometry is None or isinstance(self.geometry, GeometryTable):
            return None if self.geometry is None else self.geometry.platform
        preset = resources.files("uq").joinpath("presets", "platforms", f"{self.geometry}.toml")
        return declared_table("geometry", tomllib.loads(preset.read_text("utf-8")), GeometryTable).platform

"""The keys of ``[platform]`` that describe a robot arm of revolute and prismatic joints."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np

from rig.exceptions import quoted
from rig.toml_tables import Name, TomlTable, WrongKeyError, read_value, written
from uq.files.schema import in_unit, quantity_schema
from uq.files.units import UnitError, quantity


class Written(NamedTuple):
    """A value of a joint, which turns or slides."""

    value: float
    """Value of the quantity in SI."""
    unit: str
    """Unit of the value: rad, m or a unit derived from them."""


def of_joint(turning: str, sliding: str, *, positive: bool = False) -> msgspec.Meta:
    """Return the annotation of a value of a joint: in one unit if it turns, in the other if it slides."""

    def read(_: str, raw: Any) -> Written:
        for unit in (turning, sliding):
            try:
                value = quantity(raw, unit)
            except UnitError:
                continue
            if positive and value <= 0:
                raise ValueError(f"is {quoted(raw)}: write a value above zero")
            return Written(value, unit)
        raise ValueError(f'is {quoted(raw)}: write a value with its unit, such as "1 {turning}", or "1 {sliding}"')

    return written(read, {"anyOf": [quantity_schema(turning), quantity_schema(sliding)]})


def _range(path: str, raw: Any) -> tuple[Written, Written]:
    low, high = read_value(path, raw, tuple[Position, Position])
    if low.unit != high.unit or low.value >= high.value:
        raise ValueError(f"is {quoted(raw)}: write the lower limit first, both in units of one kind")
    return low, high


Position = Annotated[Written, of_joint("rad", "m")]
RANGE = {"type": "array", "items": {"anyOf": [quantity_schema("rad"), quantity_schema("m")]}, "minItems": 2}


class JointTable(TomlTable, frozen=True, kw_only=True):
    """``[[platform.joint]]``: limits of an arm's joint; where none is stated, those of the URDF."""

    name: Name | None = None
    """Name of the joint in the URDF; missing: every joint that no other table names."""
    fixed: Position | None = None
    """Position in which the joint stays, such as a gripper's, which then is no joint of the arm."""
    position: Annotated[tuple[Written, Written], written(_range, {**RANGE, "maxItems": 2})] | None = None
    """Lowest and highest position of the joint."""
    speed: Annotated[Written, of_joint("rad/s", "m/s", positive=True)] | None = None
    """Largest speed of the joint, either way."""
    acceleration: Annotated[Written, of_joint("rad/s^2", "m/s^2", positive=True)] | None = None
    """Largest acceleration of the joint, either way, which no URDF states."""
    effort: Annotated[Written, of_joint("N*m", "N", positive=True)] | None = None
    """Largest torque of the joint, or force if it slides, either way."""


class ArmKeys(TomlTable, frozen=True, kw_only=True):
    """The keys of an arm."""

    urdf: str | None = None
    """An arm's description, a URDF beside the experiment; the collision shapes of its links must not touch."""
    tool: Name | None = None
    """Frame of the URDF that is the load cell's: its origin is Q, its axes are those of B."""
    home: tuple[Position, ...] = ()
    """Position of each joint, from base to tool, at which an arm's motion starts and ends; missing: all at zero."""
    rate: Annotated[float, in_unit("Hz", above=0, most=1e5)] = 500.0
    """Rate of an arm's commands and of its sensors' samples."""
    clearance: Annotated[float, in_unit("m", least=0)] = 0.02
    """Least distance between an arm's links that no joint connects."""
    floor: Annotated[float, in_unit("m")] | None = None
    """Height from an arm's base that its links keep the clearance from; missing: there is no floor."""
    joint: tuple[JointTable, ...] = ()
    """Limits of an arm's joints beside those of its URDF."""

    def arm(self, folder: Path) -> "DeclaredArm | None":
        """Return the arm, its URDF in a folder; None: another platform."""
        if self.urdf is None:
            return None
        keys = {key: getattr(self, key) for key in ArmKeys.__struct_fields__}
        return DeclaredArm(**keys | {"urdf": str(folder / self.urdf)})

    def check_arm(self, is_arm: bool) -> None:
        """Refuse an arm without its keys, and the keys of an arm elsewhere."""
        if is_arm:
            for key in ("urdf", "tool"):
                if getattr(self, key) is None:
                    raise WrongKeyError(key, "an arm needs it")
            names = [joint.name for joint in self.joint]
            if twice := next((name for name in names if names.count(name) > 1), None):
                raise WrongKeyError("joint", "write one table each", f"names {quoted(twice)} twice")
            if any(joint.fixed is not None and joint.name is None for joint in self.joint):
                raise WrongKeyError("joint", "add its name", "fixes a joint without a name")
            return
        defaults = ArmKeys()
        for key in ArmKeys.__struct_fields__:
            if not np.array_equal(getattr(self, key), getattr(defaults, key)):
                raise WrongKeyError(key, 'write kind = "arm", or remove it', "describes an arm")


class DeclaredArm(ArmKeys, frozen=True, kw_only=True):
    """A robot arm as declared; its URDF is not yet read."""

    @property
    def fixed(self) -> dict[str, Written]:
        """Position of each joint that is fixed."""
        return {str(joint.name): joint.fixed for joint in self.joint if joint.fixed is not None}

    urdf: str
    """Path of the arm's description."""
    tool: Name
    """Frame of the URDF that is the load cell's."""

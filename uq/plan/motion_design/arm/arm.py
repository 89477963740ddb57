"""A robot arm from its experiment: the chain of joints of its URDF, home, and what each joint may do."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.motion.serial_arm.joint_series import JointStates
from identify.motion.serial_arm.serial_chain import SerialChain
from identify.rigid_body.inertia import pack
from rig.exceptions import listed, quoted
from uq.experiment.arm_table import DeclaredArm, JointTable, Written
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.urdf_model import MovedLink, Pose, UrdfJoint, UrdfModel, urdf_model

UNITS = {"position": ("rad", "m"), "speed": ("rad/s", "m/s"), "acceleration": ("rad/s^2", "m/s^2"),
         "effort": ("N*m", "N")}  # fmt: skip
"""Units of a joint's quantities, first of one that turns, then of one that slides."""


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm with its limits; joints from base to tool, SI units."""

    declared: DeclaredArm
    chain: SerialChain
    names: tuple[str, ...]
    """Names of the joints."""
    home: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n 2"]
    """Lowest and highest position; infinite where a joint turns without end."""
    speed: Float[np.ndarray, " n"]
    """Largest speed of each joint, either way [rad/s or m/s]."""
    acceleration: Float[np.ndarray, " n"]
    effort: Float[np.ndarray, " n"]

    @classmethod
    def of(cls, experiment: Experiment) -> "Arm":
        """Read the arm that an experiment describes.

        Raises:
            ExperimentError: it describes none, the URDF is no serial chain, or a limit is missing or cannot be.
        """
        declared = experiment.arm
        if declared is None:
            raise ExperimentError('missing key platform.kind: write kind = "arm", and describe the arm')
        model = urdf_model(declared.urdf, "platform.urdf", declared.fixed)
        chain, joints = _serial(model, model.link_of(declared.tool, "platform.tool"))
        names = tuple(joint.name for joint in joints)
        limits = list(_limits(declared, joints))
        speed, acceleration, effort = (np.array([rates[k] for _, rates in limits]) for k in range(3))
        arm = cls(
            declared=declared, chain=chain, names=names, home=_home(declared, names, chain.prismatic),
            position=np.array([position for position, _ in limits]), speed=speed, acceleration=acceleration,
            effort=effort,
        )  # fmt: skip
        for name, at, (low, high) in zip(names, arm.home, arm.position, strict=True):
            if not low <= at <= high:
                raise ExperimentError(f"platform.home: joint {name} at {at:.4g} is not within {low:.4g} … {high:.4g}")
        return arm

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.names)

    @property
    def middle(self) -> Float[np.ndarray, " n"]:
        """Middle of each joint's range; zero where a joint turns without end."""
        low, high = np.where(np.isinf(self.position), 0.0, self.position).T
        return (low + high) / 2

    @property
    def half(self) -> Float[np.ndarray, " n"]:
        """Half of each joint's range; infinite where a joint turns without end."""
        return np.diff(self.position, axis=1)[:, 0] / 2

    def joint_shares(self, joints: JointStates) -> dict[str, Any]:
        """Return by quantity which share of its limit a motion uses, with its sign; joints of NumPy or JAX.

        A position counts from the middle of its range.
        """
        return {
            "position": (joints.position - self.middle[None]) / self.half[None],
            "speed": joints.speed / self.speed[None],
            "acceleration": joints.acceleration / self.acceleration[None],
        }


def _serial(model: UrdfModel, tool: str) -> tuple[SerialChain, list[UrdfJoint]]:
    """The chain that moves the tool and its joints, refused unless each has one axis and there are no others."""
    urdf, moving = Path(model.urdf).name, [joint for joint in model.joints_to(tool) if joint.moves]
    for joint in model.joints.values():
        name = quoted(joint.name)
        if joint.moves and joint not in moving:
            raise ExperimentError(
                f"joint {name} of {urdf} does not move the tool: fix it in place, by a "
                f'[[platform.joint]] with name = {name} and fixed = "0 mm" or "0 deg"'
            )
        if joint.moves and not joint.has_one_axis:
            raise ExperimentError(f"joint {name} of {urdf} neither turns nor slides about one axis alone")
    if not moving:
        raise ExperimentError(f"no joint of {urdf} moves the frame at platform.tool: name another")
    return _chain(model, *model.chain_to(tool)), moving


def _chain(model: UrdfModel, links: list[MovedLink], tool: Pose) -> SerialChain:
    """The chain of these links, each with all that is fixed to it."""
    bodies = [model.carried_by(link.joint.child) for link in links]
    return SerialChain(
        rotation=np.array([link.rotation for link in links]), position=np.array([link.position for link in links]),
        axis=np.array([link.axis for link in links]), tool_rotation=tool[0], tool_position=tool[1],
        mass=np.array([body.mass for body in bodies]), r_cg=np.array([body.r_cg for body in bodies]),
        inertia=np.array([pack(body.inertia) for body in bodies]),
        prismatic=tuple(link.joint.slides for link in links),
    )  # fmt: skip


def _home(declared: DeclaredArm, names: tuple[str, ...], slides: tuple[bool, ...]) -> np.ndarray:
    home = declared.home
    if home and len(home) != len(names):
        raise ExperimentError(f"platform.home has {len(home)} positions: the joints are {listed(names)}")
    for k, value in enumerate(home):
        _check_unit(value, "position", slides[k], f"platform.home[{k}]")
    return np.array([value.value for value in home]) if home else np.zeros(len(names))


def _limits(
    declared: DeclaredArm, joints: list[UrdfJoint]
) -> Iterator[tuple[tuple[float, float], tuple[float, float, float]]]:
    """Range of each joint, and its largest speed, acceleration and effort."""
    tables = {table.name: table for table in declared.joint if table.fixed is None}
    names = [joint.name for joint in joints]
    if unknown := [name for name in tables if name is not None and name not in names]:
        raise ExperimentError(f"platform.joint: unknown joint {quoted(unknown[0])}: the joints are {listed(names)}")
    for joint in joints:
        name, sliding, (low, high) = joint.name, joint.slides, joint.range
        table = tables.get(name, tables.get(None, JointTable()))
        if (stated := table.position) is not None:
            _check_unit(stated[0], "position", sliding, f"platform.joint.{name}.position")
            low, high = (float(value.value) for value in stated)
        if not low < high:
            raise ExperimentError(f"no range of joint {name} in the URDF: state position in [[platform.joint]]")
        largest = {"speed": joint.speed, "acceleration": np.inf, "effort": joint.effort}
        for what in largest:
            value = getattr(table, what)
            if value is not None:
                _check_unit(value, what, sliding, f"platform.joint.{name}.{what}")
                largest[what] = value.value
            if not 0 < largest[what] < np.inf:
                raise ExperimentError(f"no largest {what} of joint {name}: state {what} in [[platform.joint]]")
        yield (low, high), (largest["speed"], largest["acceleration"], largest["effort"])


def _check_unit(value: Written, what: str, sliding: bool, path: str) -> None:
    """Refuse an angle of a joint that slides, and a length of one that turns."""
    if value.unit != (wanted := UNITS[what][sliding]):
        raise ExperimentError(
            f"{path} is in {value.unit}: write it in {wanted}, since the joint {('turns', 'slides')[sliding]}"
        )

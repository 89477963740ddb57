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
from uq.runs.recorded.urdf_model import frame_number, joint_axis, urdf_model

UNITS = {"position": ("rad", "m"), "speed": ("rad/s", "m/s"), "acceleration": ("rad/s^2", "m/s^2"),
         "effort": ("N*m", "N")}  # fmt: skip
"""Units of a joint's quantities, first of one that turns, then of one that slides."""


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial arm with its limits; joints from base to tool, SI units."""

    declared: DeclaredArm
    model: Any
    """Pinocchio's model of the robot."""
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
            RigError: Pinocchio is not installed.
        """
        declared = experiment.arm
        if declared is None:
            raise ExperimentError('missing key platform.kind: write kind = "arm", and describe the arm')
        model = urdf_model(declared.urdf, "platform.urdf", "arms", declared.fixed)
        frame = frame_number(model, declared.tool, declared.urdf, "platform.tool")
        numbers = _serial(model, frame, declared.urdf)
        axes = np.array([joint_axis(model, k, declared.urdf) for k in numbers])
        slides = tuple(bool(np.abs(axis[:3]).max() > 0) for axis in axes)
        placements, links = [model.jointPlacements[k] for k in numbers], [model.inertias[k] for k in numbers]
        tool = model.frames[frame].placement
        chain = SerialChain(
            rotation=np.array([placement.rotation for placement in placements]),
            position=np.array([placement.translation for placement in placements]),
            axis=np.where(np.array(slides)[:, None], axes[:, :3], axes[:, 3:]), tool_rotation=np.array(tool.rotation),
            tool_position=np.array(tool.translation), mass=np.array([link.mass for link in links]),
            r_cg=np.array([link.lever for link in links]),
            inertia=np.array([pack(np.array(link.inertia)) for link in links]), prismatic=slides,
        )  # fmt: skip
        names = tuple(model.names[k] for k in numbers)
        limits = list(_limits(model, declared, numbers, slides))
        speed, acceleration, effort = (np.array([rates[k] for _, rates in limits]) for k in range(3))
        arm = cls(
            declared=declared, model=model, chain=chain, names=names, home=_home(declared, names, slides),
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

    def in_pinocchio(self, q: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
        """Return joint positions as Pinocchio keeps them: a joint without end as cosine and sine."""
        joints = [self.model.joints[self.model.getJointId(name)] for name in self.names]
        return np.concatenate(
            [[np.cos(x), np.sin(x)] if joint.nq == 2 else [x] for x, joint in zip(q, joints, strict=True)]
        )


def _serial(model: Any, frame: int, urdf: str) -> list[int]:
    """Numbers of the joints that move a frame, refused unless each has one axis and there are no others."""
    numbers = [number for number in model.supports[model.frames[frame].parentJoint] if number > 0]
    for number in range(1, model.njoints):
        name, joint = quoted(model.names[number]), model.joints[number]
        if number not in numbers:
            raise ExperimentError(
                f"joint {name} of {Path(urdf).name} does not move the tool: fix it in place, by a "
                f'[[platform.joint]] with name = {name} and fixed = "0 mm" or "0 deg"'
            )
        if joint.nv != 1 or "Helical" in joint.shortname() or "Mimic" in joint.shortname():
            raise ExperimentError(f"joint {name} of {Path(urdf).name} neither turns nor slides about one axis alone")
    if not numbers:
        raise ExperimentError(f"no joint of {Path(urdf).name} moves the frame at platform.tool: name another")
    return numbers


def _home(declared: DeclaredArm, names: tuple[str, ...], slides: tuple[bool, ...]) -> np.ndarray:
    home = declared.home
    if home and len(home) != len(names):
        raise ExperimentError(f"platform.home has {len(home)} positions: the joints are {listed(names)}")
    for k, value in enumerate(home):
        _check_unit(value, "position", slides[k], f"platform.home[{k}]")
    return np.array([value.value for value in home]) if home else np.zeros(len(names))


def _limits(
    model: Any, declared: DeclaredArm, numbers: list[int], slides: tuple[bool, ...]
) -> Iterator[tuple[tuple[float, float], tuple[float, float, float]]]:
    """Range of each joint, and its largest speed, acceleration and effort."""
    tables = {table.name: table for table in declared.joint if table.fixed is None}
    names = [model.names[number] for number in numbers]
    if unknown := [name for name in tables if name is not None and name not in names]:
        raise ExperimentError(f"platform.joint: unknown joint {quoted(unknown[0])}: the joints are {listed(names)}")
    for number, name, sliding in zip(numbers, names, slides, strict=True):
        table = tables.get(name, tables.get(None, JointTable()))
        at, speed = model.joints[number].idx_q, model.joints[number].idx_v
        endless = model.joints[number].nq == 2
        low, high = (-np.inf, np.inf) if endless else (model.lowerPositionLimit[at], model.upperPositionLimit[at])
        if (stated := table.position) is not None:
            _check_unit(stated[0], "position", sliding, f"platform.joint.{name}.position")
            low, high = (float(value.value) for value in stated)
        if not low < high:
            raise ExperimentError(f"no range of joint {name} in the URDF: state position in [[platform.joint]]")
        largest = {"speed": model.velocityLimit[speed], "acceleration": np.inf, "effort": model.effortLimit[speed]}
        for what in largest:
            value = getattr(table, what)
            if value is not None:
                _check_unit(value, what, sliding, f"platform.joint.{name}.{what}")
                largest[what] = value.value
            if not 0 < largest[what] < np.inf:
                raise ExperimentError(f"no largest {what} of joint {name}: state {what} in [[platform.joint]]")
        yield (float(low), float(high)), (float(largest["speed"]), largest["acceleration"], float(largest["effort"]))


def _check_unit(value: Written, what: str, sliding: bool, path: str) -> None:
    """Refuse an angle of a joint that slides, and a length of one that turns."""
    if value.unit != (wanted := UNITS[what][sliding]):
        raise ExperimentError(
            f"{path} is in {value.unit}: write it in {wanted}, since the joint {('turns', 'slides')[sliding]}"
        )

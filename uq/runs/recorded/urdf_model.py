"""A robot's description, URDF, read by the optional package Pinocchio."""

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
import scipy

from rig.exceptions import RigError, listed, on_one_line, quoted, reason
from rig.read_limits import require_file
from uq.experiment.arm_table import Written
from uq.files.mistakes import ExperimentError

LARGEST = 2**24
"""Bytes of a URDF."""
MOST_LINKS, DEEPEST = 1000, 100
"""Links of a robot, and links one behind the other: libraries follow them by recursion, which ends in a crash of the
process at some thousands, and their time grows with the square. Humanoids with hands have some 150 and 40."""
NONE_FIXED: Mapping[str, Written] = MappingProxyType({})
MOST_NESTED = 100
"""Elements of XML inside one another; a URDF has some ten."""


class _Outline:
    """Counts what a URDF holds while an XML parser reads it, and refuses too much."""

    def __init__(self, name: str) -> None:
        self.name, self.links, self.nested = name, 0, 0
        self.parents: dict[str, str] = {}
        self.joint: dict[str, str] = {}

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self.nested += 1
        if tag.startswith("xacro:") or any("${" in value or "$(" in value for value in attributes.values()):
            raise ExperimentError(
                f"xacro macros in {self.name}: run `xacro ROBOT.xacro > ROBOT.urdf`, and give that file"
            )
        if self.nested > MOST_NESTED:
            raise ExperimentError(f"over {MOST_NESTED} elements inside one another in {self.name}: give a plain URDF")
        if self.nested == 2:  # children of the robot
            self.links, self.joint = self.links + (tag == "link"), {}
        elif self.nested == 3 and tag in ("parent", "child"):
            self.joint[tag] = attributes.get("link", "")

    def end(self, tag: str) -> None:
        """An element ends."""
        if self.nested == 2 and tag == "joint" and len(self.joint) == 2:
            child = self.joint["child"]
            if child in self.parents:
                raise ExperimentError(f"two joints of {self.name} move link {quoted(child)}: remove one")
            self.parents[child] = self.joint["parent"]
        self.nested -= 1

    def refuse_type(self, *_: object) -> None:
        """A document type begins, whose entities may grow without limit."""
        raise ExperimentError(f"a document type (<!DOCTYPE>) in {self.name}: remove it, no URDF needs one")

    def check(self) -> None:
        """Refuse too many links."""
        if self.links > MOST_LINKS:
            raise ExperimentError(f"{self.links} links in {self.name}: leave {MOST_LINKS} at most")
        for link in self.parents:
            depth, at = 1, link
            while (at := self.parents.get(at, "")) and depth <= DEEPEST:
                depth += 1
            if depth > DEEPEST:
                raise ExperimentError(
                    f"over {DEEPEST} links in a chain in {self.name}, or in a circle: leave {DEEPEST} at most"
                )


def urdf_text(urdf: str, key: str) -> str:
    """Return the text of a URDF of a size that libraries can read.

    Args:
        urdf: its path.
        key: which key of the experiment names it.

    Raises:
        ExperimentError: there is no such file, it is no XML, or it holds too much.
    """
    path = Path(urdf)
    if not path.exists():
        raise ExperimentError(f"no file {urdf} at {key}: give its path relative to the experiment's folder")
    require_file(path)
    if path.stat().st_size > LARGEST:
        raise ExperimentError(f"{urdf} at {key} has over {LARGEST >> 20} MiB: give a robot's description")
    outline, parser = _Outline(f"{path.name} at {key}"), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = outline.start, outline.end
    parser.StartDoctypeDeclHandler = outline.refuse_type
    try:
        text = path.read_bytes().decode().lstrip("\ufeff \t\r\n")
        parser.Parse(text, True)
    except (UnicodeDecodeError, expat.ExpatError) as error:
        raise _no_urdf(urdf, key, error) from None
    outline.check()
    return text


def _no_urdf(urdf: str, key: str, error: Exception) -> ExperimentError:
    first = on_one_line(str(error).strip().partition("\n")[0]) or "it cannot be parsed"
    return ExperimentError(f"no URDF {urdf} at {key} ({reason(first)}): give a robot's description")


def urdf_robot(urdf: str, key: str, fixed: Mapping[str, Written] = NONE_FIXED) -> ElementTree.Element:
    """Return the robot of a URDF, some joints of it fixed at a position.

    Args:
        urdf: its path.
        key: which key of the experiment names it.
        fixed: positions of joints by their names.

    Raises:
        ExperimentError: there is no such file or joint, or it is no URDF; an angle for a joint that slides.
    """
    robot = ElementTree.fromstring(urdf_text(urdf, key))  # noqa: S314 - refused there: types, depth, size
    joints = {joint.get("name", ""): joint for joint in robot.findall("joint")}
    for name, position in fixed.items():
        if name not in joints:
            raise ExperimentError(f"platform.joint: {Path(urdf).name} has no joint {quoted(name)}")
        if (joints[name].get("type") == "prismatic") != (position.unit == "m"):
            raise ExperimentError(
                f"platform.joint: fixed of {quoted(name)} is in {position.unit}: mm for a prismatic joint, else deg"
            )
        try:
            _fix(joints[name], position.value)
        except ValueError:
            raise ExperimentError(f"no direction or position in joint {quoted(name)} of {Path(urdf).name}") from None
    return robot


def _vector(element: ElementTree.Element | None, key: str, default: str) -> np.ndarray:
    return np.array((default if element is None else element.get(key, default)).split(), float)


def _fix(joint: ElementTree.Element, position: float) -> None:
    """Make a joint of a URDF a fixed one, its child where the joint's position puts it."""
    origin, axis = joint.find("origin"), joint.find("axis")
    place, angles = (_vector(origin, key, "0 0 0") for key in ("xyz", "rpy"))
    along = _vector(axis, "xyz", "1 0 0")
    if not np.isfinite(along).all() or not along.any():
        raise ValueError
    step = position * along / np.linalg.norm(along)
    turn = scipy.spatial.transform.Rotation.from_euler("xyz", angles)  # about the parent's axes, one after the other
    if joint.get("type") == "prismatic":
        place = place + turn.apply(step)
    else:
        turn *= scipy.spatial.transform.Rotation.from_rotvec(step)
    joint.set("type", "fixed")
    for child in [child for child in joint if child.tag not in ("parent", "child")]:
        joint.remove(child)
    pose = {"xyz": place, "rpy": turn.as_euler("xyz")}
    ElementTree.SubElement(joint, "origin", {key: " ".join(map(repr, map(float, pose[key]))) for key in pose})


def urdf_model(urdf: str, key: str, what: str, fixed: Mapping[str, Written] = NONE_FIXED) -> Any:
    """Return Pinocchio's model of a URDF.

    Args:
        urdf: its path.
        key: which key of the experiment names it.
        what: what needs it, in the plural.
        fixed: positions of joints that are to be fixed, by their names.

    Raises:
        ExperimentError: there is no such file or joint, or it is no URDF.
        RigError: Pinocchio is not installed.
    """
    try:
        import pinocchio
    except ImportError:
        extra = "arm" if what == "arms" else "urdf"
        raise RigError(f"{what} need Pinocchio: `pip install inertia-uq[{extra}]` installs it") from None
    text = _with_limits(urdf_robot(urdf, key, fixed))
    try:
        with silence():
            model = pinocchio.buildModelFromXML(text)
        _ = list(model.names), [frame.name for frame in model.frames]
    except (ValueError, RuntimeError) as error:
        raise _no_urdf(urdf, key, error) from None
    return model


def _with_limits(robot: ElementTree.Element) -> str:
    """Return the text of a robot, where each joint without <limit> has one that limits nothing, as Pinocchio needs it.

    Zeros stand for no range, as a missing ``lower`` and ``upper`` do.
    """
    without = [
        joint for joint in robot.findall("joint")
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None
    ]  # fmt: skip
    for joint in without:
        ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
    return ElementTree.tostring(robot, "unicode")


def frame_number(model: Any, frame: str, urdf: str, key: str) -> int:
    """Return the number of a frame of a model.

    Raises:
        ExperimentError: there is no such frame.
    """
    if not model.existFrame(frame):
        frames = listed(other.name for other in model.frames if other.name != "universe")
        raise ExperimentError(f"unknown frame {quoted(frame)} at {key}: {urdf} has {frames}")
    return int(model.getFrameId(frame))


def joint_axis(model: Any, number: int, urdf: str) -> np.ndarray:
    """Return the axis of a joint in its frame: linear, then angular, (6,); one of the two is a unit vector.

    Raises:
        ExperimentError: it has no direction: of zeros or of huge numbers, the library makes none.
    """
    joint = model.joints[number]
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0][: joint.nq]), np.zeros(1))
    axis = np.asarray(data.S, float).ravel()
    if not abs(float(np.linalg.norm(axis)) - 1.0) < 1e-9:
        raise ExperimentError(
            f"no direction in the axis of joint {quoted(model.names[number])} of {Path(urdf).name}: "
            'correct it, such as xyz="0 0 1"'
        )
    return axis


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Keep what a C++ library writes from standard error: what it raises is said."""
    sys.stderr.flush()
    try:
        before = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    os.close(nothing)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)

"""A robot's description, URDF: its links, its joints and the chain of joints that moves a frame.

As ROS reads it: a joint's frame is its child link's, so that both names stand for one frame; angles ``rpy`` are about
the parent's fixed axes; a joint without end (``continuous``) has no range; ``mimic`` makes no joint another kind.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
import scipy
from jaxtyping import Float

from rig.exceptions import listed, on_one_line, quoted, reason
from rig.read_limits import require_file
from uq.experiment.arm_table import Written
from uq.files.mistakes import ExperimentError

LARGEST = 2**24
"""Bytes of a URDF."""
MOST_LINKS, DEEPEST = 1000, 100
"""Links of a robot, and links one behind the other: MuJoCo follows them by recursion, which ends in a crash of the
process at some thousands, and its time grows with the square. Humanoids with hands have some 150 and 40."""
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


class UrdfJoint(NamedTuple):
    """A joint of a URDF; the frame of its child link is its own."""

    name: str
    kind: str
    parent: str
    child: str
    rotation: Float[np.ndarray, "3 3"]
    """Rotation at zero: takes components in the joint's frame to those in the parent link's."""
    position: Float[np.ndarray, "3"]
    """Position of the joint's frame in the parent link's [m]."""
    along: Float[np.ndarray, "3"]
    """Axis as it is written, in the joint's frame."""
    range: tuple[float, float]
    """Lowest and highest position [rad or m]; zeros where none is stated, infinite where the joint has no end."""
    speed: float
    """Largest speed [rad/s or m/s]; zero where none is stated."""
    effort: float
    """Largest effort [N·m or N]; zero where none is stated."""

    @property
    def moves(self) -> bool:
        """Whether it is no fixed joint."""
        return self.kind != "fixed"

    @property
    def slides(self) -> bool:
        """Whether it slides along its axis; else it turns."""
        return self.kind == "prismatic"

    @property
    def has_one_axis(self) -> bool:
        """Whether it turns about one axis, or slides along it."""
        return self.kind in ("revolute", "continuous", "prismatic")


class UrdfLink(NamedTuple):
    """A link's inertia; zeros where the URDF states none."""

    mass: float
    r_cg: Float[np.ndarray, "3"]
    """Centre of gravity in the link's frame [m]."""
    inertia: Float[np.ndarray, "3 3"]
    """Tensor about the centre of gravity, in the link's axes [kg·m²]."""


class MovedLink(NamedTuple):
    """A link that a joint moves, in a chain of such."""

    joint: UrdfJoint
    rotation: Float[np.ndarray, "3 3"]
    """Rotation of the joint's frame at zero: takes components in it to those in the frame of the preceding link."""
    position: Float[np.ndarray, "3"]
    """Position of the joint from the preceding one, in the frame of the preceding link [m]."""
    axis: Float[np.ndarray, "3"]
    """Unit vector along the joint's axis, in its frame."""


Pose = tuple[np.ndarray, np.ndarray]
"""Rotation and position of a frame in another one."""
AT_BASE: Pose = np.eye(3), np.zeros(3)


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """Links and joints of a URDF, which make one tree."""

    urdf: str
    links: Mapping[str, UrdfLink]
    joints: Mapping[str, UrdfJoint]
    """Joints by their child link."""

    def link_of(self, frame: str, key: str) -> str:
        """Return the link of a frame, which is called by its link or by the joint that moves it.

        Raises:
            ExperimentError: there is no such frame; ``key`` names it.
        """
        by_joint = {joint.name: child for child, joint in self.joints.items()}
        link = frame if frame in self.links else by_joint.get(frame)
        if link is None:
            raise ExperimentError(f"unknown frame {quoted(frame)} at {key}: {self.urdf} has {listed(self.links)}")
        return link

    def joints_to(self, link: str) -> list[UrdfJoint]:
        """Return the joints from the base to a link, the fixed ones too."""
        joints: list[UrdfJoint] = []
        while link in self.joints:
            joints.append(self.joints[link])
            link = joints[-1].parent
        return joints[::-1]

    def chain_to(self, link: str) -> tuple[list[MovedLink], Pose]:
        """Return the links that move a link, from the base, and the link's pose in the last of them.

        Raises:
            ExperimentError: a joint has an axis without direction.
        """
        pose, chain = AT_BASE, []
        for joint in self.joints_to(link):
            pose = _placed(pose, joint)
            if joint.moves:
                chain.append(MovedLink(joint, *pose, self._axis(joint)))
                pose = AT_BASE
        return chain, pose

    def carried_by(self, link: str) -> UrdfLink:
        """Return the inertia of a link with all that is fixed to it, in its frame."""
        return _sum(list(self._fixed_to(link)))

    def _fixed_to(self, link: str) -> Iterator[UrdfLink]:
        """Yield a link and all that is fixed to it, in its frame."""
        fixed = [(link, AT_BASE)]
        while fixed:
            name, (turn, place) = fixed.pop()
            mass, r_cg, inertia = self.links[name]
            yield UrdfLink(mass, place + turn @ r_cg, turn @ inertia @ turn.T)
            below = (joint for joint in self.joints.values() if joint.parent == name and not joint.moves)
            fixed += [(joint.child, _placed((turn, place), joint)) for joint in below]

    def _axis(self, joint: UrdfJoint) -> np.ndarray:
        """The unit vector of an axis, refused where it is of zeros or of numbers whose squares have no end."""
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(joint.along))
        if not 0 < length < np.inf:
            raise ExperimentError(
                f"no direction in the axis of joint {quoted(joint.name)} of {Path(self.urdf).name}: "
                'correct it, such as xyz="0 0 1"'
            )
        return joint.along / length


def _placed(pose: Pose, joint: UrdfJoint) -> Pose:
    """The pose of a joint at zero whose parent link has this one."""
    turn, place = pose
    return turn @ joint.rotation, place + turn @ joint.position


def _sum(links: list[UrdfLink]) -> UrdfLink:
    """Several links of one frame as one, by the parallel-axis theorem."""
    mass = sum(link.mass for link in links)
    if mass == 0:
        return UrdfLink(0.0, np.zeros(3), np.sum([link.inertia for link in links], axis=0))
    r_cg = np.sum([link.mass * link.r_cg for link in links], axis=0) / mass
    shifts = [link.r_cg - r_cg for link in links]
    parts = [
        link.inertia + link.mass * (at @ at * np.eye(3) - np.outer(at, at))
        for link, at in zip(links, shifts, strict=True)
    ]
    return UrdfLink(mass, r_cg, np.sum(parts, axis=0))


KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def urdf_model(urdf: str, key: str, fixed: Mapping[str, Written] = NONE_FIXED) -> UrdfModel:
    """Read a URDF.

    Args:
        urdf: its path.
        key: which key of the experiment names it.
        fixed: positions of joints that are to be fixed, by their names.

    Raises:
        ExperimentError: there is no such file or joint, or it is no URDF.
    """
    robot = urdf_robot(urdf, key, fixed)
    try:
        if robot.tag != "robot":
            raise ValueError(f"its element is <{robot.tag}>, not <robot>")
        links = {link.get("name", ""): _link(link) for link in robot.findall("link")}
        joints = [_joint(joint) for joint in robot.findall("joint")]
        _check_tree(robot, links, joints)
    except ValueError as error:
        raise ExperimentError(f"no URDF {urdf} at {key} ({error}): correct it") from None
    return UrdfModel(urdf, links, {joint.child: joint for joint in joints})


def _numbers(element: ElementTree.Element | None, key: str, default: str, owner: str, count: int = 1) -> np.ndarray:
    """The numbers of an attribute, refused with what they belong to unless there are so many and all are finite."""
    text = default if element is None else element.get(key, default)
    try:
        values = np.array(text.split(), float)
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{key}={quoted(text)} of {owner}")
    return values


def _origin(element: ElementTree.Element, owner: str) -> Pose:
    origin = element.find("origin")
    angles, place = (_numbers(origin, key, "0 0 0", owner, 3) for key in ("rpy", "xyz"))
    return scipy.spatial.transform.Rotation.from_euler("xyz", angles).as_matrix(), place


def _link(element: ElementTree.Element) -> UrdfLink:
    inertial, owner = element.find("inertial"), f"link {quoted(element.get('name', ''))}"
    if inertial is None:
        return UrdfLink(0.0, np.zeros(3), np.zeros((3, 3)))
    turn, r_cg = _origin(inertial, owner)
    tensor = inertial.find("inertia")
    values = {key: _numbers(tensor, key, "0", owner)[0] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    rows = [[values["i" + min(a + b, b + a)] for b in "xyz"] for a in "xyz"]
    return UrdfLink(
        float(_numbers(inertial.find("mass"), "value", "0", owner)[0]), r_cg, turn @ np.array(rows) @ turn.T
    )


def _joint(element: ElementTree.Element) -> UrdfJoint:
    name, form = element.get("name", ""), element.get("type", "")
    owner, limit = f"joint {quoted(name)}", element.find("limit")
    if form not in KINDS:
        raise ValueError(f"type={quoted(form)} of {owner}")
    ends = (element.find(end) for end in ("parent", "child"))
    parent, child = ("" if end is None else end.get("link", "") for end in ends)
    rotation, position = _origin(element, owner)
    low, high, speed, effort = (
        float(_numbers(limit, key, "0", owner)[0]) for key in ("lower", "upper", "velocity", "effort")
    )
    return UrdfJoint(
        name=name, kind=form, parent=parent, child=child, rotation=rotation, position=position,
        along=_numbers(element.find("axis"), "xyz", "1 0 0", owner, 3), speed=speed, effort=effort,
        range=(-math.inf, math.inf) if form == "continuous" else (low, high),
    )  # fmt: skip


def _check_tree(robot: ElementTree.Element, links: Mapping[str, UrdfLink], joints: list[UrdfJoint]) -> None:
    """Refuse names that are missing or stand for two, joints between links that are not there, and several bases."""
    for kind in ("link", "joint"):
        names = [element.get("name", "") for element in robot.findall(kind)]
        twice = next((name for k, name in enumerate(names) if not name or name in names[:k]), None)
        if twice is not None:
            raise ValueError(f"two are named {kind} {quoted(twice)}" if twice else f"a {kind} has no name")
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ValueError(f"joint {quoted(joint.name)} is of link {quoted(link)}, which is not there")
    bases = [link for link in links if link not in {joint.child for joint in joints}]
    if len(bases) != 1:
        raise ValueError(f"joints must leave one base, but they leave {listed(bases) if bases else 'none'}")

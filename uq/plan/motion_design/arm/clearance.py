"""Distances of an arm's links from each other and from the floor: lower bounds for the search, MuJoCo for the check.

The shapes are the collision shapes of the URDF, a mesh its convex hull; links that a joint connects may touch, as may
those that a SRDF names or that touch at home with one link between them, by their construction. For the search every
shape is covered by spheres along its longest axis. Their distance from the other shape, in closed form, is at most that
of the two shapes, and the larger of both ways round is a close bound, of which JAX has the gradient. The check asks
MuJoCo for the shapes themselves.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from identify.motion.serial_arm.serial_chain import poses
from identify.rigid_body.rotation import from_quaternions
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.mujoco_model import FLOOR, mujoco_library, shapes_model
from uq.runs.recorded.urdf_model import urdf_text

CLOSER = 3
"""Covering spheres in a shape's length, in its radii."""
FAR = 100.0
"""Distance beyond which shapes count as so far apart [m]."""


class Touch(NamedTuple):
    """Two links that come too near."""

    first: str
    second: str
    instant: int
    """Number of the instant."""


class Shape(NamedTuple):
    """A link's collision shape: a cylinder about its z, or the box that holds any other."""

    name: str
    """Name of the link."""
    number: int
    """Number of the shape in MuJoCo's model."""
    link: int
    """Number of the frame that carries the shape: 0 the base, k the link that joint k moves."""
    rotation: Float[np.ndarray, "3 3"]
    """Rotation from the shape's axes to the link's."""
    position: Float[np.ndarray, "3"]
    """Position of the shape's middle, in the link's frame [m]."""
    half: Float[np.ndarray, "3"]
    """Half of the shape's size along each of its axes [m]."""
    is_round: bool

    def lowest(self, upwards: Float[Array, "3"]) -> Float[Array, ""]:
        """Return how far it reaches below its middle, if up is this in its own axes [m]."""
        if self.is_round:
            across = jnp.sqrt(upwards[0] ** 2 + upwards[1] ** 2 + 1e-12)
            return self.half[0] * across + self.half[2] * jnp.abs(upwards[2])
        return jnp.abs(upwards) @ self.half

    def cover(self) -> tuple[Float[np.ndarray, "s 3"], float]:
        """Return centres, in the link's frame, and the radius of spheres along its longest axis that hold it."""
        longest = 2 if self.is_round else int(np.argmax(self.half))
        across = np.delete(self.half, longest)
        wide = float(across[0] if self.is_round else np.linalg.norm(across))
        count = int(np.ceil(CLOSER * self.half[longest] / max(wide, 1e-3)))
        along = np.zeros((count, 3))
        along[:, longest] = self.half[longest] * (2 * np.arange(count) + 1 - count) / count
        return along @ self.rotation.T + self.position, float(np.hypot(wide, self.half[longest] / count))


def distance(
    point: Float[Array, "p s 3"], half: Float[Array, "p 1 3"], is_round: Bool[Array, "p 1"]
) -> Float[Array, "p s"]:
    """Return how far points are outside of shapes, in the shapes' own axes; negative inside [m]."""
    across = jnp.sqrt((point[..., :2] ** 2).sum(axis=-1) + 1e-12)
    beyond = jnp.abs(point) - half
    radial = jnp.stack([across - half[..., 0], jnp.full_like(across, -jnp.inf), beyond[..., 2]], axis=-1)
    beyond = jnp.where(is_round[..., None], radial, beyond)
    outside = jnp.sqrt((jnp.maximum(beyond, 0.0) ** 2).sum(axis=-1) + 1e-12)
    return outside + jnp.minimum(beyond.max(axis=-1), 0.0)


@dataclass(frozen=True, eq=False)
class Clearance:
    """An arm's shapes, and the pairs of them that must keep their distance."""

    arm: Arm
    model: Any
    """MuJoCo's, of the shapes."""
    shapes: tuple[Shape, ...]
    checked: tuple[tuple[int, int], ...]
    """Pairs of shapes that must keep their distance; the number after the last shape's is the floor."""
    pairs: tuple[tuple[int, int], ...]
    """Pairs that the search keeps apart, some of those in ``checked``."""
    may_touch: tuple[tuple[str, str], ...]
    """Links that may touch: those that touch at home, or that the SRDF names."""
    margins: Mapping[tuple[int, int], float]
    """Distance that a pair must keep which is nearer at home than the clearance, by construction [m]."""

    @classmethod
    def of(cls, arm: Arm) -> "Clearance":
        """Read the shapes of an arm's URDF.

        Raises:
            ExperimentError: a shape cannot be read, or links are too near each other at home.
            RigError: MuJoCo is not installed.
        """
        disabled, model = _disabled(arm.declared.urdf), shapes_model(arm)
        shapes = tuple(_shape(model, number) for number in range(model.ngeom) if model.geom(number).name != FLOOR)
        checked = tuple(_pairs(shapes, disabled, floor=arm.declared.floor is not None))
        clearance = cls(arm, model, shapes, checked=checked, pairs=(), may_touch=(), margins={})
        distances = dict(clearance._near_at_home())
        touching = {pair for pair, distance in distances.items() if distance <= 0}
        may_touch = {*disabled, *((clearance._link(first), clearance._link(second)) for first, second in touching)}
        margins = {pair: distance / 2 for pair, distance in distances.items() if distance > 0}
        checked = tuple(pair for pair in checked if pair not in touching)
        pairs = [pair for pair in checked if pair not in margins and pair[1] < len(shapes)]
        clearance = replace(
            clearance, checked=checked, pairs=tuple(pairs), may_touch=tuple(sorted(may_touch)), margins=margins
        )
        # what only seems too near is left to the check
        bounds = np.asarray(jax.jit(clearance.gaps)(jnp.asarray(arm.home)))
        apart = [pair for pair, gap in zip(pairs, bounds, strict=False) if gap > arm.declared.clearance]
        return replace(clearance, pairs=tuple(apart))

    def _near_at_home(self) -> Iterator[tuple[tuple[int, int], float]]:
        """Yield the pairs that are nearer at home than the clearance, with one link between them, and their distance.

        Raises:
            ExperimentError: others are, which are so near in this pose alone.
        """
        for pair, distance in zip(self.checked, self.distances(self.arm.home), strict=True):
            if distance > self.arm.declared.clearance:
                continue
            first, second = map(self._link, pair)
            if second == FLOOR or abs(self.shapes[pair[0]].link - self.shapes[pair[1]].link) > 2:
                raise ExperimentError(
                    f"platform.home: {first} is closer to {second} than platform.clearance: choose another home, or "
                    "smaller collision shapes"
                )
            yield pair, distance

    def distances(self, q: Float[np.ndarray, " n"]) -> Iterator[float]:
        """Yield the distance of each pair of ``checked`` at joint positions, negative where the two overlap [m]."""
        mujoco, (data, geoms) = mujoco_library(), self._workspace
        data.qpos[:] = q
        mujoco.mj_kinematics(self.model, data)
        for first, second in geoms:
            yield mujoco.mj_geomDistance(self.model, data, first, second, FAR, None)

    @cached_property
    def _workspace(self) -> tuple[Any, list[tuple[int, int]]]:
        """MuJoCo's data, and the numbers in its model of each pair of ``checked``."""
        numbers = [shape.number for shape in self.shapes]
        if self.arm.declared.floor is not None:
            numbers.append(int(self.model.geom(FLOOR).id))
        pairs = [(numbers[first], numbers[second]) for first, second in self.checked]
        return mujoco_library().MjData(self.model), pairs

    def exceptions(self) -> Iterator[str]:
        """Yield what keeps less than the clearance, as sentences."""
        if not any(shape.link for shape in self.shapes):
            yield "No link that moves has a collision shape: nothing is kept apart."
        if self.may_touch:
            pairs = "; ".join(" and ".join(pair) for pair in self.may_touch)
            yield f"May touch, as they do at home or as the SRDF says: {pairs}."
        for (first, second), margin in self.margins.items():
            yield (
                f"{self._link(first)} and {self._link(second)} are {1e3 * 2 * margin:.3g} mm apart at home, less than "
                "platform.clearance: half of that is kept."
            )

    def gaps(self, q: Float[Array, " n"]) -> Float[Array, " p"]:
        """Return a lower bound of the distance of each pair, then each moving shape's height above the floor [m]."""
        frames = poses(self.arm.chain, q)
        turns = jnp.concatenate([jnp.eye(3)[None], frames.rotation])
        places = jnp.concatenate([jnp.zeros((1, 3)), frames.position])
        gaps = [self._between(turns, places)] if self.pairs else []
        moving = [shape for shape in self.shapes if shape.link > 1]
        if (floor := self.arm.declared.floor) is not None and moving:
            heights = [places[shape.link][2] + turns[shape.link][2] @ shape.position for shape in moving]
            lowest = [shape.lowest(turns[shape.link][2] @ shape.rotation) for shape in moving]
            gaps.append(jnp.stack(heights) - jnp.stack(lowest) - floor)
        return jnp.concatenate(gaps) if gaps else jnp.zeros(0)

    def _between(self, turns: Float[Array, "m 3 3"], places: Float[Array, "m 3"]) -> Float[Array, " p"]:
        """A lower bound of the distance of each pair: the larger of its two ways round."""
        covers = [shape.cover() for shape in self.shapes]
        most = max(len(centres) for centres, _ in covers)
        filled = np.array([np.resize(centres, (most, 3)) for centres, _ in covers])
        _, _, link, turn, place, half, is_round = (np.array(values) for values in zip(*self.shapes, strict=True))
        radius = np.array([size for _, size in covers])
        spheres = places[link][:, None] + jnp.einsum("aij,asj->asi", turns[link], filled)
        middle = places[link] + jnp.einsum("aij,aj->ai", turns[link], place)
        axes = jnp.einsum("aij,ajk->aik", turns[link], turn)
        covered, other = np.concatenate([np.array(self.pairs), np.array(self.pairs)[:, ::-1]]).T
        local = jnp.einsum("pik,psi->psk", axes[other], spheres[covered] - middle[other][:, None])
        outside = distance(local, jnp.asarray(half[other])[:, None], jnp.asarray(is_round[other])[:, None])
        return (outside.min(axis=1) - radius[covered]).reshape(2, -1).max(axis=0)

    def touches(self, q: Float[np.ndarray, "t n"]) -> Iterator[Touch]:
        """Yield the first pair of each instant that is nearer than the clearance, by the shapes themselves."""
        margins = [self.margins.get(pair, self.arm.declared.clearance) for pair in self.checked]
        for instant, at in enumerate(q):
            for pair, margin, distance in zip(self.checked, margins, self.distances(at), strict=True):
                if distance <= margin:
                    yield Touch(self._link(pair[0]), self._link(pair[1]), instant)
                    break

    def name(self, number: int) -> str:
        """Return what to call a gap of :meth:`gaps`."""
        if number < len(self.pairs):
            return " and ".join(map(self._link, self.pairs[number]))
        moving = [k for k, shape in enumerate(self.shapes) if shape.link > 1]
        return f"{self._link(moving[number - len(self.pairs)])} and {FLOOR}"

    def _link(self, number: int) -> str:
        """The name of a shape's link."""
        return self.shapes[number].name if number < len(self.shapes) else FLOOR


def _disabled(urdf: str) -> set[tuple[str, str]]:
    """Pairs of links that a SRDF of the URDF's name beside it leaves out; none where there is no such file."""
    path = Path(urdf).with_suffix(".srdf")
    if not path.exists():
        return set()
    robot = ElementTree.fromstring(urdf_text(str(path), "platform.urdf"))  # noqa: S314 - refused there
    return {(pair.get("link1", ""), pair.get("link2", "")) for pair in robot.findall("disable_collisions")}


def _pairs(shapes: tuple[Shape, ...], disabled: set[tuple[str, str]], *, floor: bool) -> Iterator[tuple[int, int]]:
    """Pairs that must not touch: none that a joint connects or is disabled, and the floor with what moves above it."""
    for b, second in enumerate(shapes):
        for a, first in enumerate(shapes[:b]):
            named = {(first.name, second.name), (second.name, first.name)}
            if abs(first.link - second.link) > 1 and not named & disabled:
                yield a, b
    if floor:
        yield from ((number, len(shapes)) for number, shape in enumerate(shapes) if shape.link > 1)


def _shape(model: Any, number: int) -> Shape:
    """A shape of MuJoCo's model; a mesh has the axes of its file."""
    geom, forms = model.geom(number), mujoco_library().mjtGeom
    form, turn, middle = forms(int(geom.type[0])), _rotation(geom.quat), np.zeros(3)
    radius, length, _ = geom.size
    halves = {
        forms.mjGEOM_BOX: geom.size, forms.mjGEOM_SPHERE: (radius, radius, radius),
        forms.mjGEOM_CYLINDER: (radius, radius, length), forms.mjGEOM_CAPSULE: (radius, radius, length + radius),
    }  # fmt: skip
    if form == forms.mjGEOM_MESH:
        mesh = model.mesh(geom.dataid[0])
        principal = _rotation(model.mesh_quat[mesh.id])  # whose axes MuJoCo gives to the shape
        corners = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]] @ principal.T
        turn, middle = turn @ principal.T, (corners.min(axis=0) + corners.max(axis=0)) / 2
        halves[form] = np.ptp(corners, axis=0) / 2
    return Shape(
        name=geom.name.rpartition("/")[0], number=number, link=int(geom.bodyid[0]), rotation=turn,
        position=geom.pos + turn @ middle, half=np.array(halves[form], float),
        is_round=form not in (forms.mjGEOM_BOX, forms.mjGEOM_MESH),
    )  # fmt: skip


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """The matrix of a quaternion of MuJoCo, scalar first."""
    return from_quaternions(quaternion[None])[0]

"""Distances of an arm's links from each other and from the floor: lower bounds for the search, Coal for the check.

The shapes are the collision shapes of the URDF; links that a joint connects may touch, as may those that a SRDF names
or that touch at home with one link between them, by their construction. For the search every shape is
covered by spheres along its longest axis. Their distance from the other shape, in closed form, is at most that of the
two shapes, and the larger of both ways round is a close bound, of which JAX has the gradient. The check asks the
library Coal, which comes with Pinocchio, for the shapes themselves.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from identify.motion.serial_arm.serial_chain import poses
from rig.exceptions import reason
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.collision_meshes import with_mesh_files
from uq.runs.recorded.urdf_model import silence, urdf_text

FLOOR = "the floor"
CLOSER = 3
"""Covering spheres in a shape's length, in its radii."""


class Touch(NamedTuple):
    """Two links that come too near."""

    first: str
    second: str
    instant: int
    """Number of the instant."""


class Shape(NamedTuple):
    """A link's collision shape: a cylinder about its z, or the box that holds any other."""

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
    geometry: Any
    """Pinocchio's, with these pairs."""
    shapes: tuple[Shape, ...]
    pairs: tuple[tuple[int, int], ...]
    may_touch: tuple[tuple[str, str], ...]
    """Links that may touch: those that touch at home, or that the SRDF names."""
    margins: Mapping[tuple[int, int], float]
    """Distance that a pair must keep which is nearer at home than the clearance, by construction [m]."""

    @classmethod
    def of(cls, arm: Arm) -> "Clearance":
        """Read the shapes of an arm's URDF.

        Raises:
            ExperimentError: a shape cannot be read, or links are too near each other at home.
        """
        import pinocchio

        disabled = _disabled(arm.declared.urdf)
        geometry = _geometry(arm, disabled)
        shapes = tuple(_shape(shape) for shape in geometry.geometryObjects if shape.name != FLOOR)
        clearance = cls(arm, geometry, shapes, pairs=(), may_touch=(), margins={})
        distances = dict(clearance._near_at_home())
        touching = [pair for pair, distance in distances.items() if distance <= 0]
        for first, second in touching:
            geometry.removeCollisionPair(pinocchio.CollisionPair(first, second))
        may_touch = {*disabled, *((clearance._link(first), clearance._link(second)) for first, second in touching)}
        margins = {pair: distance / 2 for pair, distance in distances.items() if distance > 0}
        kept = [(pair.first, pair.second) for pair in geometry.collisionPairs if pair.second < len(shapes)]
        pairs = [pair for pair in kept if pair not in margins]
        clearance = replace(clearance, pairs=tuple(pairs), may_touch=tuple(sorted(may_touch)), margins=margins)
        # what only seems too near is left to the check
        bounds = np.asarray(jax.jit(clearance.gaps)(jnp.asarray(arm.home)))
        apart = [pair for pair, gap in zip(pairs, bounds, strict=False) if gap > arm.declared.clearance]
        return replace(clearance, pairs=tuple(apart))

    def _near_at_home(self) -> Iterator[tuple[tuple[int, int], float]]:
        """Yield the pairs that are nearer at home than the clearance, with one link between them, and their distance.

        Raises:
            ExperimentError: others are, which are so near in this pose alone.
        """
        import pinocchio

        data, collisions = self.arm.model.createData(), self.geometry.createData()
        home, shapes = self.arm.in_pinocchio(self.arm.home), self.geometry.geometryObjects
        pinocchio.computeDistances(self.arm.model, data, self.geometry, collisions, home)
        for pair, result in zip(self.geometry.collisionPairs, collisions.distanceResults, strict=True):
            if result.min_distance > self.arm.declared.clearance:
                continue
            first, second = self._link(pair.first), self._link(pair.second)
            if second == FLOOR or abs(shapes[pair.first].parentJoint - shapes[pair.second].parentJoint) > 2:
                raise ExperimentError(
                    f"platform.home: {first} is closer to {second} than platform.clearance: choose another home, or "
                    "smaller collision shapes"
                )
            yield (pair.first, pair.second), result.min_distance

    def exceptions(self) -> Iterator[str]:
        """Yield what keeps less than the clearance, as sentences."""
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
        if (floor := self.arm.declared.floor) is not None:
            moving = [shape for shape in self.shapes if shape.link > 1]
            heights = [places[shape.link][2] + turns[shape.link][2] @ shape.position for shape in moving]
            lowest = [shape.lowest(turns[shape.link][2] @ shape.rotation) for shape in moving]
            gaps.append(jnp.stack(heights) - jnp.stack(lowest) - floor)
        return jnp.concatenate(gaps) if gaps else jnp.zeros(0)

    def _between(self, turns: Float[Array, "m 3 3"], places: Float[Array, "m 3"]) -> Float[Array, " p"]:
        """A lower bound of the distance of each pair: the larger of its two ways round."""
        covers = [shape.cover() for shape in self.shapes]
        most = max(len(centres) for centres, _ in covers)
        filled = np.array([np.resize(centres, (most, 3)) for centres, _ in covers])
        link, turn, place, half, is_round = (np.array(values) for values in zip(*self.shapes, strict=True))
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
        import pinocchio

        model, data, collisions = self.arm.model, self.arm.model.createData(), self.geometry.createData()
        for pair, request in zip(self.geometry.collisionPairs, collisions.collisionRequests, strict=True):
            request.security_margin = self.margins.get((pair.first, pair.second), self.arm.declared.clearance)
        for instant, at in enumerate(q):
            position = self.arm.in_pinocchio(at)
            if not pinocchio.computeCollisions(model, data, self.geometry, collisions, position, True):
                continue
            for pair, result in zip(self.geometry.collisionPairs, collisions.collisionResults, strict=True):
                if result.isCollision():
                    yield Touch(self._link(pair.first), self._link(pair.second), instant)
                    break

    def name(self, number: int) -> str:
        """Return what to call a gap of :meth:`gaps`."""
        if number < len(self.pairs):
            return " and ".join(map(self._link, self.pairs[number]))
        moving = [k for k, shape in enumerate(self.shapes) if shape.link > 1]
        return f"{self._link(moving[number - len(self.pairs)])} and {FLOOR}"

    def _link(self, number: int) -> str:
        """The name of a shape's link."""
        shape = self.geometry.geometryObjects[number]
        return FLOOR if shape.name == FLOOR else str(self.arm.model.frames[shape.parentFrame].name)


def _disabled(urdf: str) -> set[tuple[str, str]]:
    """Pairs of links that a SRDF of the URDF's name beside it leaves out; none where there is no such file."""
    path = Path(urdf).with_suffix(".srdf")
    if not path.exists():
        return set()
    robot = ElementTree.fromstring(urdf_text(str(path), "platform.urdf"))  # noqa: S314 - refused there
    return {(pair.get("link1", ""), pair.get("link2", "")) for pair in robot.findall("disable_collisions")}


def _geometry(arm: Arm, disabled: set[tuple[str, str]]) -> Any:
    """Pinocchio's geometry of an arm, with the pairs that must not touch: none that a joint connects or is disabled."""
    import coal
    import pinocchio

    urdf = arm.declared.urdf
    robot = ElementTree.tostring(with_mesh_files(arm.declared), "unicode")
    try:
        with silence():
            geometry = pinocchio.buildGeomFromUrdfString(arm.model, robot, pinocchio.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise ExperimentError(
            f"collision shapes of {Path(urdf).name} cannot be read ({reason(str(error).strip())}): "
            "describe links by boxes, cylinders and spheres"
        ) from None
    geometry.removeAllCollisionPairs()
    links = [shape.parentJoint for shape in geometry.geometryObjects]
    names = [arm.model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    for b in range(len(links)):
        for a in range(b):
            if abs(links[a] - links[b]) > 1 and not {(names[a], names[b]), (names[b], names[a])} & disabled:
                geometry.addCollisionPair(pinocchio.CollisionPair(a, b))
    if arm.declared.floor is not None:
        plane = coal.Halfspace(np.array([0.0, 0.0, 1.0]), arm.declared.floor)
        floor = geometry.addGeometryObject(pinocchio.GeometryObject(FLOOR, 0, pinocchio.SE3.Identity(), plane))
        for number, link in enumerate(links):
            if link > 1:
                geometry.addCollisionPair(pinocchio.CollisionPair(number, floor))
    return geometry


def _shape(model: Any) -> Shape:
    """A shape from Pinocchio's."""
    model.geometry.computeLocalAABB()
    box = model.geometry.aabb_local
    low, high = np.array(box.min_).ravel(), np.array(box.max_).ravel()
    turn, place = np.array(model.placement.rotation), np.array(model.placement.translation)
    is_round = type(model.geometry).__name__ in ("Cylinder", "Capsule", "Sphere")
    return Shape(
        link=int(model.parentJoint), rotation=turn, position=place + turn @ (low + high) / 2, half=(high - low) / 2,
        is_round=is_round,
    )  # fmt: skip

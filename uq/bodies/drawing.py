"""A body from its drawing: parts of simple shapes as functions of their uncertain sizes, places and masses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import numpy as np

from identify.rigid_body.rotation import from_axes
from identify.rigid_body.solids import Part, Solid, composite, cuboid, cylinder, sphere
from rig.exceptions import quoted
from rig.toml_tables import TomlTable, WrongKeyError
from uq.files.mistakes import ExperimentError
from uq.files.schema import ROTATION
from uq.sources.tolerances import UncertainQuantity, mean, uncertain, uncertain_vector

Values = Mapping[str, Any]
"""Values of the quantities by their keys."""
Model = Callable[[Values], Any]
AXES = {"x": "y, z, x", "y": "z, x, y", "z": "x, y, z"}
"""A turn that brings a cylinder's own z along each axis of the drawing."""


Length = Annotated[UncertainQuantity, uncertain("m", above=0)]
Mass = Annotated[UncertainQuantity, uncertain("kg", above=0)]
Density = Annotated[UncertainQuantity, uncertain("kg/m^3", above=0)]
Vector = tuple[UncertainQuantity, UncertainQuantity, UncertainQuantity]
ORIGIN: Vector = (0.0, 0.0, 0.0)


@dataclass
class Quantities:
    """The quantities of a file by their keys, gathered for the models that are functions of them."""

    by_key: dict[str, UncertainQuantity]

    def add(self, key: str, quantity: UncertainQuantity) -> str:
        """Add a quantity and return the key under which models find it."""
        self.by_key[key] = quantity
        return key

    def add_vector(self, key: str, quantities: Vector) -> Callable[[Values], Any]:
        """Add three quantities and return the function that makes a vector of them."""
        names = [self.add(f"{key}[{k}]", quantity) for k, quantity in enumerate(quantities)]
        return lambda values: jnp.stack([values[name] for name in names])


class MaterialTable(TomlTable, frozen=True, kw_only=True):
    """``[material.NAME]``: a material of which parts are made."""

    density: Density


class PartKeys(TomlTable, frozen=True, kw_only=True, tag_field="shape"):
    """``[[part]]``: a simple solid."""

    name: str = ""
    """Name of the part in messages and contributions."""
    hole: bool = False
    """Whether the part is a hole, so that its mass is subtracted."""
    position: Annotated[Vector, uncertain_vector("m")] = ORIGIN
    """Position of the part's centre, in the drawing's frame."""
    rotation: Annotated[np.ndarray, ROTATION] | None = None
    """Rotation from the part's axes to the drawing's."""
    mass: Mass | None = None
    """Mass of the part; without it, and without density and material, the part shares the body's mass by volume."""
    density: Density | None = None
    material: str | None = None
    """Name of a table [material.NAME] whose density the part has."""

    def __post_init__(self) -> None:
        """Refuse two ways to state the mass."""
        stated = [key for key in ("mass", "density", "material") if getattr(self, key) is not None]
        if len(stated) > 1:
            raise WrongKeyError("", f"has {' and '.join(stated)}: give one")

    @property
    def turn(self) -> np.ndarray:
        """The rotation from the part's axes to the drawing's."""
        return np.eye(3) if self.rotation is None else self.rotation


class RoundPart(PartKeys, frozen=True, kw_only=True):
    """A round solid, or a hollow one."""

    diameter: Length
    inner_diameter: Length | None = None
    """Diameter of the bore."""

    def __post_init__(self) -> None:
        """Refuse a bore that leaves nothing."""
        super().__post_init__()
        if self.inner_diameter is not None and mean(self.inner_diameter) >= mean(self.diameter):
            raise WrongKeyError("inner_diameter", "write the bore's diameter", "is not below diameter")

    def diameters(self, where: str, quantities: Quantities) -> tuple[str, str | None]:
        """Add the outer and, where there is one, the inner diameter."""
        outer = quantities.add(f"{where}.diameter", self.diameter)
        if self.inner_diameter is None:
            return outer, None
        return outer, quantities.add(f"{where}.inner_diameter", self.inner_diameter)


class CylinderPart(RoundPart, frozen=True, kw_only=True, tag="cylinder"):
    """A cylinder along its own z, or a tube."""

    length: Length
    axis: Literal["x", "y", "z"] | None = None
    """Axis of the drawing along which the part lies, an alternative to ``rotation``."""

    def __post_init__(self) -> None:
        """Refuse two ways to state the direction."""
        super().__post_init__()
        if self.axis is not None and self.rotation is not None:
            raise WrongKeyError("", "has axis and rotation: give one")

    @property
    def turn(self) -> np.ndarray:
        """The rotation from the part's axes to the drawing's."""
        return super().turn if self.axis is None else from_axes(AXES[self.axis]).T

    def solid(self, where: str, quantities: Quantities) -> Callable[[Values], Solid]:
        """Return the solid as a function of its sizes."""
        outer, inner = self.diameters(where, quantities)
        length = quantities.add(f"{where}.length", self.length)
        return lambda values: cylinder(values[outer], values[length], values[inner] if inner else 0.0)


class CuboidPart(PartKeys, frozen=True, kw_only=True, tag="cuboid"):
    """A cuboid along its own axes."""

    size: Annotated[Vector, uncertain_vector("m", above=0)]
    """Lengths of the edges."""

    def solid(self, where: str, quantities: Quantities) -> Callable[[Values], Solid]:
        """Return the solid as a function of its sizes."""
        size = quantities.add_vector(f"{where}.size", self.size)
        return lambda values: cuboid(size(values))


class SpherePart(RoundPart, frozen=True, kw_only=True, tag="sphere"):
    """A sphere, or a hollow one."""

    def solid(self, where: str, quantities: Quantities) -> Callable[[Values], Solid]:
        """Return the solid as a function of its sizes."""
        outer, inner = self.diameters(where, quantities)
        return lambda values: sphere(values[outer], values[inner] if inner else 0.0)


Shape = CylinderPart | CuboidPart | SpherePart


@dataclass(frozen=True)
class _Drawn:
    """A part of a drawing, as functions of the quantities."""

    solid: Callable[[Values], Solid]
    position: Callable[[Values], Any]
    rotation: np.ndarray
    sign: float
    """Sign of the part's mass: 1, or −1 for a hole."""
    mass: Callable[[Values, Solid], Any] | None
    """Mass of the part [kg]; None: it shares the body's mass by volume."""


def drawing(
    mass: UncertainQuantity | None,
    material: Mapping[str, MaterialTable],
    tables: Sequence[Shape],
    quantities: Quantities,
) -> Model:
    """Return the ten parameters in the drawing's frame as a function of the quantities that its file holds.

    Args:
        mass: of the body, for the parts that state none; None: not stated.
        material: by the names that parts call.
        tables: the parts.
        quantities: where the file's quantities are gathered.

    Raises:
        ExperimentError: parts and masses that do not fit.
    """
    mass_key = None if mass is None else quantities.add("mass", mass)
    for name, table in material.items():
        quantities.add(f"material.{name}.density", table.density)
    parts = [_part(f"part[{table.name or k}]", table, quantities, material) for k, table in enumerate(tables)]
    shared = any(part.mass is None for part in parts)
    if shared and mass_key is None:
        raise ExperimentError("missing key mass: the body's, or mass, density or material of each part")
    if mass_key is not None and not shared:
        raise ExperimentError("mass is not needed: every part has a mass of its own; remove one or the other")

    def model(values: Values) -> Any:
        solids = [part.solid(values) for part in parts]
        density = 0.0 if mass_key is None else _shared_density(values[mass_key], parts, solids, values)
        return composite([_placed(part, solid, values, density) for part, solid in zip(parts, solids, strict=True)])

    return model


def _shared_density(body_mass: Any, parts: Sequence[_Drawn], solids: list[Solid], values: Values) -> Any:
    """The density of the parts that share the body's mass: what is left of it over their volume."""
    pairs = list(zip(parts, solids, strict=True))
    stated = sum(part.mass(values, solid) for part, solid in pairs if part.mass is not None)
    return (body_mass - stated) / sum(part.sign * solid.volume for part, solid in pairs if part.mass is None)


def _placed(part: _Drawn, solid: Solid, values: Values, density: Any) -> Part:
    mass = part.sign * density * solid.volume if part.mass is None else part.mass(values, solid)
    return Part(jnp.asarray(mass), solid.mean_squares, part.rotation, part.position(values))


def _part(where: str, table: Shape, quantities: Quantities, material: Mapping[str, MaterialTable]) -> _Drawn:
    if f"{where}.position[0]" in quantities.by_key:
        raise ExperimentError(f"two parts {where}: give each its own name")
    sign = -1.0 if table.hole else 1.0
    solid = table.solid(where, quantities)
    position = quantities.add_vector(f"{where}.position", table.position)
    return _Drawn(
        solid=solid, position=position, rotation=table.turn, sign=sign,
        mass=_mass(where, table, quantities, material, sign),
    )  # fmt: skip


def _mass(
    where: str, table: Shape, quantities: Quantities, material: Mapping[str, MaterialTable], sign: float
) -> Callable[[Values, Solid], Any] | None:
    if table.mass is not None:
        mass = quantities.add(f"{where}.mass", table.mass)
        return lambda values, solid: sign * values[mass]
    if table.density is not None:
        density = quantities.add(f"{where}.density", table.density)
    elif table.material is None:
        return None
    elif table.material not in material:
        raise ExperimentError(
            f"unknown {where}.material {quoted(table.material)}: one of {', '.join(material) or 'none'}"
        )
    else:
        density = f"material.{table.material}.density"
    return lambda values, solid: sign * values[density] * solid.volume

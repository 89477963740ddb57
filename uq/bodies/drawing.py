"""A body from its drawing: parts of simple shapes as functions of their uncertain sizes, places and masses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from identify.rigid_body.rotation import from_axes
from identify.rigid_body.solids import Part, Solid, composite, cuboid, cylinder, sphere
from rig.toml_tables import TomlError
from uq.experiment.rotation_key import read_rotation
from uq.files.document import ExperimentError, Table
from uq.sources.distributions import Distribution
from uq.sources.tolerances import Known, uncertain, uncertain_vector

Values = Mapping[str, Any]
"""Values of the quantities by their keys."""
Model = Callable[[Values], Any]
AXES = {"x": "y, z, x", "y": "z, x, y", "z": "x, y, z"}
"""A turn that brings a cylinder's own z along each axis of the drawing."""


@dataclass
class Quantities:
    """The quantities of a file by their keys, gathered while it is read."""

    known: dict[str, Known]

    def keep(self, table: Table, key: str, unit: str, **options: Any) -> str:
        """Read a quantity and return the key under which models find it."""
        name = table.path(key)
        self.known[name] = uncertain(table, key, unit, **options)
        return name

    def keep_vector(self, table: Table, key: str, unit: str, *default: Any) -> Callable[[Values], Any]:
        """Read three quantities and return the function that makes a vector of them."""
        names = [f"{table.path(key)}[{k}]" for k in range(3)]
        self.known.update(zip(names, uncertain_vector(table, key, unit, *default), strict=True))
        return lambda values: jnp.stack([values[name] for name in names])

    def best(self, name: str) -> float:
        """Return a quantity's best estimate."""
        known = self.known[name]
        return float(known.mean) if isinstance(known, Distribution) else float(known)


@dataclass(frozen=True)
class _Drawn:
    """A part of a drawing, as functions of the quantities."""

    solid: Callable[[Values], Solid]
    position: Callable[[Values], Any]
    rotation: np.ndarray
    sign: float
    """−1 for a hole."""
    mass: Callable[[Values, Solid], Any] | None
    """Its mass [kg]; None: it shares the body's by volume."""


def drawing(top: Table, quantities: Quantities) -> Model:
    """Return the ten parameters in the drawing's frame as a function of the quantities that its file holds.

    Raises:
        ExperimentError: a part that is not one.
    """
    whole = quantities.keep(top, "mass", "kg", positive=True) if "mass" in top.content else None
    materials = {name: _density(top, name, quantities) for name in top.mapping("material")}
    parts = top.tables("part", lambda table: _part(table, quantities, materials))
    shared = any(part.mass is None for part in parts)
    if not parts:
        raise ExperimentError("no [[part]]: write one for each part of the body")
    if shared and whole is None:
        raise ExperimentError("missing key mass: the body's, or mass, density or material of each part")
    if whole is not None and not shared:
        raise ExperimentError("mass is not needed: every part has a mass of its own; remove the one or the others")

    def model(values: Values) -> Any:
        solids = [part.solid(values) for part in parts]
        density = 0.0 if whole is None else _shared_density(values[whole], parts, solids, values)
        return composite([_placed(part, solid, values, density) for part, solid in zip(parts, solids, strict=True)])

    return model


def _shared_density(whole: Any, parts: tuple[_Drawn, ...], solids: list[Solid], values: Values) -> Any:
    """The density of the parts that share the body's mass: what is left of it over their volume."""
    pairs = list(zip(parts, solids, strict=True))
    own = sum(part.mass(values, solid) for part, solid in pairs if part.mass is not None)
    return (whole - own) / sum(part.sign * solid.volume for part, solid in pairs if part.mass is None)


def _placed(part: _Drawn, solid: Solid, values: Values, density: Any) -> Part:
    mass = part.sign * density * solid.volume if part.mass is None else part.mass(values, solid)
    return Part(jnp.asarray(mass), solid.mean_squares, part.rotation, part.position(values))


def _density(top: Table, name: str, quantities: Quantities) -> str:
    table = Table(f"material.{name}", top.content["material"][name])
    key = quantities.keep(table, "density", "kg/m^3", positive=True)
    table.finish()
    return key


def _part(table: Table, quantities: Quantities, materials: Mapping[str, str]) -> _Drawn:
    if table.path("position[0]") in quantities.known:
        raise ExperimentError(f"two parts {table.where}: give each its own name")
    table.typed("name", str, "")
    shape = table.choice("shape", tuple(SHAPES))
    sign = -1.0 if table.typed("hole", bool, False) else 1.0
    part = _Drawn(
        SHAPES[shape](table, quantities),
        quantities.keep_vector(table, "position", "m", ["0 m"] * 3),
        _turn(table, shape),
        sign,
        _mass(table, quantities, materials, sign),
    )
    table.finish()
    return part


def _mass(
    table: Table, quantities: Quantities, materials: Mapping[str, str], sign: float
) -> Callable[[Values, Solid], Any] | None:
    stated = [key for key in ("mass", "density", "material") if key in table.content]
    if len(stated) > 1:
        raise ExperimentError(f"{table.where} has {' and '.join(stated)}: give one")
    if not stated:
        return None
    if stated == ["mass"]:
        own = quantities.keep(table, "mass", "kg", positive=True)
        return lambda values, solid: sign * values[own]
    if stated == ["density"]:
        density = quantities.keep(table, "density", "kg/m^3", positive=True)
    else:
        density = materials.get(str(table.raw("material")), "")
        if not density:
            known = ", ".join(materials) or "none"
            raise ExperimentError(f"unknown {table.path('material')} {table.raw('material')!r}: one of {known}")
    return lambda values, solid: sign * values[density] * solid.volume


def _round(table: Table, quantities: Quantities) -> tuple[str, str | None]:
    """The outer and, where there is one, the inner diameter."""
    outer = quantities.keep(table, "diameter", "m", positive=True)
    if "inner_diameter" not in table.content:
        return outer, None
    inner = quantities.keep(table, "inner_diameter", "m", positive=True)
    if quantities.best(inner) >= quantities.best(outer):
        raise ExperimentError(f"{inner} is not below {outer}: write the bore's diameter")
    return outer, inner


def _cylinder(table: Table, quantities: Quantities) -> Callable[[Values], Solid]:
    outer, inner = _round(table, quantities)
    length = quantities.keep(table, "length", "m", positive=True)
    return lambda values: cylinder(values[outer], values[length], values[inner] if inner else 0.0)


def _sphere(table: Table, quantities: Quantities) -> Callable[[Values], Solid]:
    outer, inner = _round(table, quantities)
    return lambda values: sphere(values[outer], values[inner] if inner else 0.0)


def _cuboid(table: Table, quantities: Quantities) -> Callable[[Values], Solid]:
    size = quantities.keep_vector(table, "size", "m")
    for k in range(3):
        if quantities.best(f"{table.path('size')}[{k}]") <= 0:
            raise ExperimentError(f"{table.path('size')}[{k}] is not above zero: write the edge's length")
    return lambda values: cuboid(size(values))


SHAPES = {"cylinder": _cylinder, "cuboid": _cuboid, "sphere": _sphere}


def _turn(table: Table, shape: str) -> np.ndarray:
    """The rotation from a part's own axes to the drawing's."""
    if shape == "cylinder" and "axis" in table.content:
        return from_axes(AXES[table.choice("axis", tuple(AXES))]).T
    return turn_of(table, "rotation")


def turn_of(table: Table, key: str) -> np.ndarray:
    """Return the rotation of a key; none where it is missing.

    Raises:
        ExperimentError: it is no rotation.
    """
    try:
        return read_rotation(table.path(key), table.raw(key)) if table.raw(key, None) is not None else np.eye(3)
    except TomlError as error:
        raise ExperimentError(str(error)) from None
    except ValueError as error:
        raise ExperimentError(f"{table.path(key)} {error}") from None

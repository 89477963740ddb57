"""A reference body: what its drawing, or a CAD report, says that its mass, centre of gravity and tensor are.

Either is a function of quantities of which some are uncertain; the law of propagation (GUM 5.1.2) gives the ten
parameters and their covariance.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import Array

from identify.display.reporting import Shown
from identify.display.rounding import common, significant
from identify.floating_point import check_precision
from identify.rigid_body.inertia import COMPONENTS, parallel_axis, rotate
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rigid_body.principal_axes import principal
from identify.rigid_body.rotation import exponential
from rig.toml_tables import TomlTable, WrongKeyError
from uq.bodies.drawing import (
    ORIGIN,
    CuboidPart,
    CylinderPart,
    Mass,
    MaterialTable,
    Model,
    Quantities,
    SpherePart,
    Values,
    Vector,
    drawing,
)  # fmt: skip
from uq.files.document import in_file, read_document
from uq.files.mistakes import ExperimentError
from uq.files.schema import ROTATION, declared_table
from uq.sources.distributions import Distribution
from uq.sources.tolerances import UncertainQuantity, mean, uncertain, uncertain_vector

SIGNS = np.array([1.0, -1, -1, 1, -1, 1])
"""Factors from products written as ``+∫xy dm`` to the tensor's entries, and back."""
ROUNDING = 1e-3
"""Part of the largest moment by which a CAD report's rounded figures may break the triangle inequality."""


@dataclass(frozen=True, repr=False)
class Reference(Shown):
    """A reference body, in the body frame B, from Q."""

    name: str
    parameters: InertialParameters
    """The ten parameters with their covariance; NaN what is not stated."""
    contributions: Mapping[str, np.ndarray]
    """Each uncertain quantity's part of the ten variances, by its key in the file."""
    kind: Literal["drawing", "CAD report"]
    rotation: np.ndarray
    """Rotation from the drawing's axes to the body's, (3, 3)."""
    origin: np.ndarray
    """The drawing's origin from Q, in B [m]."""
    about: str = "CG"
    """The point to which a CAD report's figures refer: CG or origin."""
    products: str = "tensor"
    """Sign with which a CAD report's products are written: tensor or integral."""
    warnings: tuple[str, ...] = ()
    file: str | None = None
    sha256: str | None = None
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Content of the reference's file."""


def load_reference(path: str | Path) -> Reference:
    """Read a reference body from a file in TOML; docs/how-to/compare-with-a-drawing.md says what it holds.

    Raises:
        ExperimentError: it is not TOML, or not a reference body.
        OSError: it cannot be read.
    """
    document, sha256 = read_document(path, "a reference body")
    with in_file(path):
        body = reference(document, name=Path(path).stem)
    return replace(body, file=str(path), sha256=sha256)


class FrameTable(TomlTable, frozen=True, kw_only=True):
    """``[frame]``: position and attitude of the drawing's frame in the body frame B."""

    origin: Annotated[Vector, uncertain_vector("m")] = ORIGIN
    """The drawing's origin from Q, in B."""
    misalignment: Annotated[Vector, uncertain_vector("rad")] = ORIGIN
    """Small rotation of the drawing's frame about each axis."""
    rotation_to_body: Annotated[np.ndarray, ROTATION] = msgspec.field(default_factory=lambda: np.eye(3))
    """Rotation from the drawing's axes to the body's."""


class CadInertiaTable(TomlTable, frozen=True, kw_only=True):
    """The six components of a CAD report; products that are not written are zero."""

    I11: Annotated[UncertainQuantity, uncertain("kg*m^2")]
    I12: Annotated[UncertainQuantity, uncertain("kg*m^2")] = 0.0
    I13: Annotated[UncertainQuantity, uncertain("kg*m^2")] = 0.0
    I22: Annotated[UncertainQuantity, uncertain("kg*m^2")]
    I23: Annotated[UncertainQuantity, uncertain("kg*m^2")] = 0.0
    I33: Annotated[UncertainQuantity, uncertain("kg*m^2")]


class CadTable(TomlTable, frozen=True, kw_only=True):
    """``[cad]``: the report of a CAD program."""

    about: Literal["CG", "origin"]
    """Point to which the tensor refers: the centre of gravity, or the drawing's origin."""
    products: Literal["tensor", "integral"]
    """Sign of the products: the tensor's entries, -∫xy dm, or integrals, +∫xy dm."""
    mass: Mass | None = None
    """Mass of the body; may be missing where the tensor is about the CG."""
    cg: Annotated[Vector, uncertain_vector("m")] | None = None
    """Centre of gravity of the body; may be missing where the tensor is about the CG."""
    inertia: CadInertiaTable

    def __post_init__(self) -> None:
        """Refuse a tensor about the origin that cannot be brought to the CG."""
        for key in ("mass", "cg"):
            if self.about == "origin" and getattr(self, key) is None:
                raise WrongKeyError(key, "add it")


class BodyFile(TomlTable, frozen=True, kw_only=True):
    """A reference body: its drawing, by parts, or a CAD report."""

    name: str | None = None
    """Name of the reference body."""
    mass: Mass | None = None
    """Mass of a drawing's body, for the parts that state none."""
    material: Mapping[str, MaterialTable] = {}
    """Materials by their names."""
    part: tuple[CylinderPart | CuboidPart | SpherePart, ...] | None = None
    """The parts of a drawing."""
    cad: CadTable | None = None
    frame: FrameTable = msgspec.field(default_factory=FrameTable)

    def __post_init__(self) -> None:
        """Refuse neither, or both, of drawing and report."""
        if (self.part is None) == (self.cad is None):
            raise WrongKeyError("", "a reference body has either [[part]] (a drawing) or [cad] (its report): write one")
        if self.part is not None and not self.part:
            raise WrongKeyError("", "no [[part]]: write one for each part of the body")
        if self.cad is not None and (self.mass is not None or self.material):
            raise WrongKeyError("", "mass and material are a drawing's: remove them, or state cad.mass")


def reference(document: Mapping[str, Any], *, name: str = "reference body") -> Reference:
    """Build a reference body from the content of a file.

    Args:
        document: what a file holds; see docs/how-to/compare-with-a-drawing.md.
        name: what to call the body unless the file says.

    Raises:
        ExperimentError: it is not a reference body.
    """
    warned = check_precision("float64")
    file, quantities = declared_table("", document, BodyFile), Quantities({})
    name = name if file.name is None else file.name
    cad, frame = file.cad, file.frame
    model = drawing(file.mass, file.material, file.part or (), quantities) if cad is None else _cad(cad, quantities)
    transform = _frame(frame, quantities)
    value, covariance, contributions = _propagated(lambda values: transform(values, model(values)), quantities)
    parameters = InertialParameters(float(value[0]), value[1:4], value[4:], covariance)
    wrong = _impossible(parameters, name)
    if wrong and cad is None:
        raise ExperimentError(f"{wrong}: check holes and masses")
    warnings = (*warned, *([f"{wrong} as its report is read: check about, products and units"] if wrong else []))
    origin = np.array([mean(coordinate) for coordinate in frame.origin])
    meant = {"about": "CG", "products": "tensor"} if cad is None else {"about": cad.about, "products": cad.products}
    return Reference(
        name=name, parameters=parameters, contributions=contributions, kind="drawing" if cad is None else "CAD report",
        rotation=frame.rotation_to_body, origin=origin, warnings=warnings, document=document, **meant,
    )  # fmt: skip


def _propagated(model: Model, quantities: Quantities) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """The model's value, its first-order covariance, and each uncertain quantity's part of the variances."""
    stated = quantities.by_key.items()
    exact = {name: jnp.asarray(value) for name, value in stated if not isinstance(value, Distribution)}
    unsure = {name: value for name, value in stated if isinstance(value, Distribution)}
    means = jnp.asarray([float(value.mean) for value in unsure.values()])
    sigmas = np.array([float(value.standard_deviation) for value in unsure.values()])

    def of_unsure(values: Array) -> Array:
        return model({**exact, **dict(zip(unsure, values, strict=True))})

    if not unsure:
        return np.array(model(exact)), np.zeros((10, 10)), {}
    value, jacobian = jax.jit(lambda at: (of_unsure(at), jax.jacfwd(of_unsure)(at)))(means)
    spread = np.asarray(jacobian) * sigmas
    return np.array(value), spread @ spread.T, dict(zip(unsure, (spread**2).T, strict=True))


def _impossible(parameters: InertialParameters, name: str) -> str | None:
    """Return the reason why no body has this mass and tensor; None: one may have."""
    low, middle, high = principal(np.asarray(parameters.inertia))[0]
    if parameters.mass <= 0 or low <= 0 or low + middle < high * (1 - ROUNDING):
        return (
            f"{name} is no body: its mass is {significant(parameters.mass, 4)} kg, its principal moments are "
            f"{', '.join(common((low, middle, high), 4))} kg*m^2"
        )
    return None


def _frame(table: FrameTable, quantities: Quantities) -> Callable[[Values, Any], Any]:
    """The function that takes ten parameters in the drawing's frame to those in B from Q."""
    origin = quantities.add_vector("frame.origin", table.origin)
    small = quantities.add_vector("frame.misalignment", table.misalignment)

    def placed(values: Values, ten: Any) -> Any:
        turn = exponential(small(values)) @ jnp.asarray(table.rotation_to_body)
        return jnp.concatenate([ten[:1], origin(values) + turn @ ten[1:4], rotate(ten[4:], turn)])

    return placed


def _cad(table: CadTable, quantities: Quantities) -> Model:
    """The ten parameters of a CAD report in its frame."""
    mass = quantities.add("cad.mass", float("nan") if table.mass is None else table.mass)
    centre = None if table.cg is None else quantities.add_vector("cad.cg", table.cg)
    tensor = [quantities.add(f"cad.inertia.{name}", getattr(table.inertia, name)) for name in COMPONENTS]

    def model(values: Values) -> Any:
        inertia = jnp.stack([values[name] for name in tensor])
        cg = jnp.full(3, jnp.nan) if centre is None else centre(values)
        if table.products == "integral":
            inertia = jnp.asarray(SIGNS) * inertia
        if table.about == "origin":
            inertia = parallel_axis(inertia, -values[mass], cg)
        return jnp.concatenate([jnp.asarray(values[mass])[None], cg, inertia])

    return model

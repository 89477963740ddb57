"""A reference body: what its drawing, or a CAD report, says that its mass, centre of gravity and tensor are.

Either is a function of quantities of which some are uncertain; the law of propagation (GUM 5.1.2) gives the ten
parameters and their covariance.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from identify.precision import check_precision
from identify.rigid_body.inertia import COMPONENTS, parallel_axis, rotate
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rigid_body.rotation import exponential
from uq.bodies.drawing import Model, Quantities, Values, drawing, turn_of
from uq.files.document import ExperimentError, Table, in_file, read_document
from uq.sources.distributions import Distribution

SIGNS = np.array([1.0, -1, -1, 1, -1, 1])
"""From products written as ``+∫xy dm`` to the tensor's entries, and back."""
ROUNDING = 1e-3
"""Part of the largest moment by which a CAD report's rounded figures may break the triangle inequality."""


@dataclass(frozen=True)
class Reference:
    """A reference body, in the body frame B, from Q."""

    name: str
    parameters: InertialParameters
    """The ten parameters with their covariance; NaN what is not stated."""
    contributions: Mapping[str, np.ndarray]
    """Each uncertain quantity's part of the ten variances, by its key in the file."""
    kind: Literal["drawing", "CAD report"]
    rotation: np.ndarray
    """From the drawing's axes to the body's, (3, 3)."""
    origin: np.ndarray
    """The drawing's origin from Q, in B [m]."""
    about: str = "CG"
    """The point to which a CAD report's figures are said to refer: CG or origin."""
    products: str = "tensor"
    """The sign with which its products are said to be written: tensor or integral."""
    warnings: tuple[str, ...] = ()
    file: str | None = None
    sha256: str | None = None
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """The file's content."""


def load_reference(path: str | Path) -> Reference:
    """Read a reference body from a file in TOML; docs/expected.md says what it holds.

    Raises:
        ExperimentError: it is not TOML, or not a reference body.
        OSError: it cannot be read.
    """
    document, sha256 = read_document(path, "a reference body")
    with in_file(path):
        body = reference(document, name=Path(path).stem)
    return replace(body, file=str(path), sha256=sha256)


def reference(document: Mapping[str, Any], *, name: str = "reference body") -> Reference:
    """Build a reference body from the content of a file.

    Args:
        document: what a file holds; see docs/expected.md.
        name: what to call the body unless the file says.

    Raises:
        ExperimentError: it is not a reference body.
    """
    warned = check_precision("float64")
    top, quantities = Table("", document), Quantities({})
    if ("part" in document) == ("cad" in document):
        raise ExperimentError("a reference body has either [[part]] (a drawing) or [cad] (its report): write one")
    name = top.typed("name", str, name)
    about = products = None
    if "part" in document:
        model = drawing(top, quantities)
    else:
        about, products, model = top.table("cad", lambda table: _cad(table, quantities))
    axes, placed = top.table("frame", lambda table: _frame(table, quantities), {})
    top.finish()
    value, covariance, contributions = _propagated(lambda values: placed(values, model(values)), quantities)
    parameters = InertialParameters(float(value[0]), value[1:4], value[4:], covariance)
    wrong = _impossible(parameters, name)
    if wrong and not about:
        raise ExperimentError(f"{wrong}: check holes and masses")
    warnings = (*warned, *([f"{wrong} as its report is read: check about, products and units"] if wrong else []))
    origin = np.array([quantities.best(f"frame.origin[{k}]") for k in range(3)])
    kind: Literal["drawing", "CAD report"] = "CAD report" if about else "drawing"
    said = {"about": about or "CG", "products": products or "tensor"}
    return Reference(name, parameters, contributions, kind, axes, origin, **said, warnings=warnings, document=document)


def _propagated(model: Model, quantities: Quantities) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """The model's value, its first-order covariance, and each uncertain quantity's part of the variances."""
    known = quantities.known
    exact = {name: jnp.asarray(value) for name, value in known.items() if not isinstance(value, Distribution)}
    unsure = {name: value for name, value in known.items() if isinstance(value, Distribution)}
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
    """Why no body has this mass and tensor; None: one may have."""
    packed = np.asarray(parameters.inertia)
    low, middle, high = np.linalg.eigvalsh(packed[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
    if parameters.mass <= 0 or low <= 0 or low + middle < high * (1 - ROUNDING):
        return (
            f"{name} is no body: its mass is {parameters.mass:.4g} kg, its principal moments are {low:.4g}, "
            f"{middle:.4g}, {high:.4g} kg*m^2"
        )
    return None


def _frame(table: Table, quantities: Quantities) -> tuple[np.ndarray, Callable[[Values, Any], Any]]:
    """The frame's rotation, and the function that takes ten parameters in the drawing's frame to those in B from Q."""
    origin = quantities.keep_vector(table, "origin", "m", ["0 m"] * 3)
    small = quantities.keep_vector(table, "misalignment", "rad", ["0 rad"] * 3)
    axes = turn_of(table, "rotation_to_body")
    table.finish()

    def placed(values: Values, ten: Any) -> Any:
        turn = exponential(small(values)) @ jnp.asarray(axes)
        return jnp.concatenate([ten[:1], origin(values) + turn @ ten[1:4], rotate(ten[4:], turn)])

    return axes, placed


def _cad(table: Table, quantities: Quantities) -> tuple[str, str, Model]:
    """The conventions of a CAD report, and the ten parameters in its frame."""
    about = table.choice("about", ("CG", "origin"))
    products = table.choice("products", ("tensor", "integral"))
    optional = {"default": float("nan")} if about == "CG" else {}
    mass = quantities.keep(table, "mass", "kg", positive=True, **optional)
    centre = quantities.keep_vector(table, "cg", "m") if about == "origin" or "cg" in table.content else None
    tensor = table.table("inertia", lambda table: _tensor(table, quantities))
    table.finish()

    def model(values: Values) -> Any:
        inertia = jnp.stack([values[name] for name in tensor])
        cg = jnp.full(3, jnp.nan) if centre is None else centre(values)
        if products == "integral":
            inertia = jnp.asarray(SIGNS) * inertia
        if about == "origin":
            inertia = parallel_axis(inertia, -values[mass], cg)
        return jnp.concatenate([jnp.asarray(values[mass])[None], cg, inertia])

    return about, products, model


def _tensor(table: Table, quantities: Quantities) -> list[str]:
    """The keys of the six components; products that are not written are zero."""
    names = []
    for name in COMPONENTS:
        moment = name[1] == name[2]
        if moment or name in table.content:
            quantities.keep(table, name, "kg*m^2", positive=moment)
        else:
            quantities.known[table.path(name)] = 0.0
        names.append(table.path(name))
    table.finish()
    return names

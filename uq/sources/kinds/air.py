"""The air around the body: what it displaces lifts it, what moves along with it adds inertia without weight."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import MOMENTS, parallel_axis
from identify.rigid_body.regressor import Array, library_of
from uq.files.schema import vector
from uq.sources.draw_figures import figures
from uq.sources.source import RigConstant, Source


class Air(RigConstant):
    """Air of mass θ at a stated centre."""

    shape = ()

    def keys(self, target: str) -> dict[str, Any]:
        """Return the air's centre from the centre of gravity."""
        return {"centre_from_cg": Annotated[np.ndarray, vector("m")] | None}

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the stated lengths, zero where one is not stated."""
        lengths = {key: np.zeros(3) if length is None else length for key, length in keys.items()}
        return {key.removesuffix("_from_cg"): length for key, length in lengths.items()}


class DisplacedAir(Air):
    """Buoyancy: the force loses θ times (0, 0, g), and the moment that force's moment at the air's centre."""

    targets = {"displaced_air": "kg"}
    absence = "the air has no buoyancy"

    def value(self, source: Source, draw: Float[Array, ""] | float) -> Float[Array, "4"]:
        """Return its mass, and mass times centre."""
        centre = source.settings["centre"]
        return draw * library_of(centre).concat([np.ones(1), centre])


class EntrainedAir(Air):
    """Air that moves along, of mass θ: inertia, but no weight."""

    targets = {"entrained_air": "kg"}
    absence = "no air moves along with the body"

    def keys(self, target: str) -> dict[str, Any]:
        """Return the air's centre from the centre of gravity, and its radii of gyration."""
        radii = Annotated[np.ndarray, figures("m", (3,), least=0)] | None
        return {**super().keys(target), "radii_of_gyration": radii}

    def value(self, source: Source, draw: Float[Array, ""] | float) -> Float[Array, "10"]:
        """Return its mass, mass times centre, and packed tensor about the centre of gravity."""
        centre, radii = source.settings["centre"], source.settings["radii_of_gyration"]
        about_cg = parallel_axis(np.eye(6)[:, MOMENTS] @ radii**2, np.ones(()), centre)
        return draw * library_of(centre, radii).concat([np.ones(1), centre, about_cg])

"""The air around the body: what it displaces lifts it, what moves along with it adds inertia without weight."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import parallel_axis
from uq.files.document import Table
from uq.sources.source import ErrorKind, Source
from uq.sources.source_figures import not_negative

AT_THE_CENTRE = ["0 m"] * 3


class DisplacedAir(ErrorKind):
    """Buoyancy: the force loses θ times (0, 0, g), and the moment that force's moment at the air's centre."""

    name = "bias"
    targets = {"displaced_air": "kg"}
    shape = ()
    constant = True
    perturbs = {"displaced_air": "displaced_air"}

    def settings(self, table: Table, target: str) -> dict[str, np.ndarray]:
        """Return the air's centre from the centre of gravity."""
        return {"centre": table.vector("centre_from_cg", "m", AT_THE_CENTRE)}

    def value(self, source: Source, draw: Float[Array, ""]) -> Float[Array, "4"]:
        """Return its mass, and mass times centre."""
        return draw * jnp.concatenate([jnp.ones(1), source.settings["centre"]])


class EntrainedAir(ErrorKind):
    """Air that moves along, of mass θ: inertia, but no weight."""

    name = "bias"
    targets = {"entrained_air": "kg"}
    shape = ()
    constant = True
    perturbs = {"entrained_air": "entrained_air"}

    def settings(self, table: Table, target: str) -> dict[str, np.ndarray]:
        """Return the air's centre from the centre of gravity, and its radii of gyration."""
        radii = not_negative(table, "radii_of_gyration", table.vector("radii_of_gyration", "m", AT_THE_CENTRE))
        return {"centre": table.vector("centre_from_cg", "m", AT_THE_CENTRE), "radii_of_gyration": radii}

    def value(self, source: Source, draw: Float[Array, ""]) -> Float[Array, "10"]:
        """Return its mass, mass times centre, and packed tensor about the centre of gravity."""
        centre = jnp.asarray(source.settings["centre"])
        x, y, z = jnp.asarray(source.settings["radii_of_gyration"]) ** 2
        of_itself = jnp.stack([x, jnp.zeros(()), jnp.zeros(()), y, jnp.zeros(()), z])
        return draw * jnp.concatenate([jnp.ones(1), centre, parallel_axis(of_itself, jnp.ones(()), centre)])

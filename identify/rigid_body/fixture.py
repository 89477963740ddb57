"""A body without the fixture that it was measured with: mass, centre of gravity and tensor subtracted.

With w the whole, p the part and b the body left, all from Q in B:

    m_b = m_w - m_p,   m_b r_b = m_w r_w - m_p r_p,   I_b = I_w + m_w S(r_w - r_b) - I_p - m_p S(r_p - r_b)

where ``S(d) = |d|² 1 - d dᵀ`` (Huygens–Steiner), each tensor about its own centre of gravity.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.exceptions import RunError
from identify.rigid_body.inertia import parallel_axis
from identify.rigid_body.inertial_parameters import InertialParameters


@dataclass(frozen=True)
class Tare:
    """The fixture that was subtracted from an identified body."""

    fixture: InertialParameters
    """The fixture with the load cell's own moving plate."""
    whole: InertialParameters
    """Body and fixture together."""
    runs: tuple[tuple[str, str | None], ...] = ()
    """Name and SHA-256 of the fixture's runs; none: it was stated."""
    provenance: Mapping[str, Any] | None = None
    """Provenance of the result that identified the fixture; None: the fixture was stated."""

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it."""
        return {
            "method": "runs" if self.runs else "stated",
            "fixture": self.fixture.to_dict(),
            "with_fixture": self.whole.to_dict(),
            "runs": [{"file": name, "sha256": digest} for name, digest in self.runs],
            "provenance": None if self.provenance is None else dict(self.provenance),
        }


def check(whole: InertialParameters, fixture: InertialParameters) -> None:
    """See that a part can be taken off.

    Raises:
        RunError: a mass is not known, or the part is not lighter than the whole.
    """
    for what, parameters in (("body with its fixture", whole), ("fixture", fixture)):
        if not np.isfinite(parameters.mass):
            raise RunError(
                f"no mass of the {what}: a tare needs both masses; find them from static poses, or state them"
            )
    if fixture.mass >= whole.mass:
        raise RunError(
            f"the fixture has {fixture.mass:.6g} kg, the body with it {whole.mass:.6g} kg: check which run is which"
        )


def left_over(both: Float[Array, "20"]) -> Float[Array, "10"]:
    """Return the ten parameters of what is left, from those of the whole and of the part."""
    (mass, r_cg, inertia), (mass_of_fixture, r_cg_of_fixture, inertia_of_fixture) = _split(both[:10]), _split(both[10:])
    mass_left = mass - mass_of_fixture
    r_left = (mass * r_cg - mass_of_fixture * r_cg_of_fixture) / mass_left
    tensor = parallel_axis(inertia, mass, r_cg - r_left) - parallel_axis(
        inertia_of_fixture, mass_of_fixture, r_cg_of_fixture - r_left
    )
    return jnp.concatenate([mass_left[None], r_left, tensor])


def _split(ten: Float[Array, "10"]) -> tuple[Array, Array, Array]:
    return ten[0], ten[1:4], ten[4:]

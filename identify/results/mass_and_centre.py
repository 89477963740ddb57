"""Mass and centre of gravity of a result: where they come from, with their intervals."""

from typing import Any

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertial_parameters import InertialParameters

NAMES = ("mass, kg", *(f"centre of gravity from Q, b{axis}, mm" for axis in (1, 2, 3)))
UNITS = (1.0, 1e3, 1e3, 1e3)
"""Factors from SI to the units of ``NAMES``."""
DECLARED, POSES, ESTIMATED, LEFT = "declared", "static poses", "estimated with the tensor", "without the fixture"
"""Possible origins of mass and centre of gravity."""


def content(
    ten: InertialParameters, ends: Float[np.ndarray, "10 2"], source: str, bounds: np.ndarray | None = None
) -> dict[str, Any]:
    """Return what result.json says of mass and centre of gravity, in SI; null for what is not known or counts as exact.

    A mass that counts as exact is declared, though the centre of gravity be estimated.

    Args:
        ten: the ten parameters.
        ends: their coverage intervals of 95 % [kg, m, kg·m²].
        source: where they come from.
        bounds: conventional bounds of the ten parameters, (10, 2) [kg, m, kg·m²]; None: not known.
    """
    by_parameter = [None] * 4 if bounds is None else bounds.tolist()
    u, intervals = ten.standard_uncertainty, ends.tolist()
    has_mass, uncertain = bool(np.isfinite(ten.mass)), bool(u[0] > 0)
    mass_source = DECLARED if source == ESTIMATED and not uncertain else source
    return {
        "mass": {
            "value": ten.mass if has_mass else None,
            "standard_uncertainty": float(u[0]) if uncertain else None,
            "interval95": intervals[0] if uncertain else None,
            "conventional_bound": by_parameter[0] if has_mass else None,
            "from": mass_source if has_mass else None,
        },
        "cg": {
            "value": ten.r_cg.tolist(),
            "standard_uncertainty": u[1:4].tolist(),
            "interval95": intervals[1:4],
            "conventional_bound": None if bounds is None else by_parameter[1:4],
            "from": source,
        },
    }

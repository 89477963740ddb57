"""Contributions to an identified tensor's uncertainty, and what errors that it does not hold would add."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component

RESIDUALS, SCATTER, CG, FIXTURE = "residuals", "scatter between runs", "r_cg", "fixture taken off"
ESTIMATE = "estimate"
"""All that an estimator states by itself, where it does not tell its parts apart."""


def contributions(
    budget: Mapping[str, np.ndarray] | None, diagnostics: Mapping[str, Any], fixture: np.ndarray | None
) -> Mapping[str, np.ndarray]:
    """Return each part's contribution to the standard uncertainty of the components [kg·m²]; empty if unknown.

    The budget of the declared sources where there is one; else residuals, scatter and centre of gravity.

    Args:
        budget: contributions by source [kg·m²]; None: no sources are declared.
        diagnostics: of the fit.
        fixture: what taking a fixture off adds to the variances [(kg·m²)²]; None: nothing was taken off.
    """
    if budget is not None:
        taken_off = {} if fixture is None else {FIXTURE: np.sqrt(np.maximum(fixture, 0))}
        return {**budget, **taken_off}
    if "standard_uncertainty_from_residuals" not in diagnostics or "standard_uncertainty_from_cg" not in diagnostics:
        return {}
    residual = np.array(diagnostics["standard_uncertainty_from_residuals"])
    ratio = np.array(diagnostics["scatter_between_runs"])
    beyond = residual * np.sqrt(np.maximum(ratio**2 - 1, 0))
    parts = {RESIDUALS: residual, SCATTER: beyond, CG: np.array(diagnostics["standard_uncertainty_from_cg"])}
    return {name: values for name, values in parts.items() if values.any()}


def evaluation_type(name: str) -> str:
    """Return the type of evaluation of a part (GUM 4.2, 4.3): A by statistics of the runs, B by other means."""
    if name == FIXTURE:
        return "A, B"
    return "A" if name in (RESIDUALS, ESTIMATE) or name.startswith("scatter between") else "B"


QUANTITIES = (
    ("the mass", "g", 1e3),
    *((f"the centre of gravity on b{axis}", "mm", 1e3) for axis in (1, 2, 3)),
    *((name, "g·m²", GRAM_METRE) for name in COMPONENTS),
)
"""The ten parameters as they are said: name, unit, that unit's number in one of SI."""
LARGEST_SHARE = 1 / 3
"""Undeclared errors over u above which nothing passes: a third makes u 5 % larger, which two digits hardly show."""


class Effect(NamedTuple):
    """Effect on a result of an error that is neither declared nor estimated."""

    name: str
    """Key of the error in ``[not_included]``."""
    text: str
    """Description of the error in words."""
    figure: str
    """Typical size of the error, with its unit."""
    parameters: Float[np.ndarray, "10"]
    """Change of mass, r_CG and tensor by the error [kg, m, kg·m²]; zero for those that the estimate takes as given."""
    signed: bool
    """Whether ``parameters`` is a bias of known sign; otherwise it is a standard uncertainty."""

    @property
    def inertia(self) -> Float[np.ndarray, "6"]:
        """Change of the packed tensor by the error [kg·m²]."""
        return self.parameters[4:]


@dataclass(frozen=True)
class NotIncluded:
    """Errors that a result's intervals do not hold."""

    effects: tuple[Effect, ...]

    @property
    def together(self) -> Float[np.ndarray, "10"]:
        """Root sum of squares of the effects, a standard uncertainty of mass, r_CG and tensor [kg, m, kg·m²]."""
        return np.sqrt(np.sum([effect.parameters**2 for effect in self.effects], axis=0) + np.zeros(10))

    def share(self, u: Float[np.ndarray, "10"]) -> tuple[float, int]:
        """Return the largest of them together over u, and which of the ten parameters that is.

        Args:
            u: standard uncertainty of mass, r_CG and tensor [kg, m, kg·m²]; not finite: the parameter does not count.
        """
        together = self.together
        ratio = np.where((together > 0) & np.isfinite(u), together / np.maximum(u, 1e-300), 0.0)
        worst = int(np.argmax(ratio))
        return float(ratio[worst]), worst

    def to_dict(self) -> list[dict[str, Any]]:
        """Return the content of result.json, in SI."""
        return [
            {
                "name": effect.name,
                "figure": effect.figure,
                "signed": effect.signed,
                "inertia": by_component(effect.inertia),
                "mass": float(effect.parameters[0]),
                "cg": effect.parameters[1:4].tolist(),
            }
            for effect in self.effects
        ]

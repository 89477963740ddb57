"""Errors that are neither declared nor estimated, at typical size, and the conventional bound that holds them."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component

QUANTITIES = (
    ("the mass", "g", 1e3),
    *((f"the centre of gravity on b{axis}", "mm", 1e3) for axis in (1, 2, 3)),
    *((name, "g·m²", GRAM_METRE) for name in COMPONENTS),
)
"""The ten parameters as they are said: name, unit, that unit's number in one of SI."""
CONVENTIONAL = 2.0
"""Factor of the standard uncertainty of undeclared errors in the conventional bound.

Convention: their sizes are typical ones, known to 30 to 50 %, so that no factor has a coverage probability.
"""
LARGEST_SHARE = 1 / 3
"""u of undeclared errors over u above which a result depends on what nobody declared: a third makes u 5 % larger, which
two digits hardly show."""


class Effect(NamedTuple):
    """Effect on a result of an error that is neither declared nor estimated."""

    name: str
    """Key of the error in ``[undeclared]``."""
    text: str
    """Description of the error in words."""
    figure: str
    """Typical size of the error, with its unit."""
    changes: Float[np.ndarray, "10 k"]
    """Change of mass, r_CG and tensor by one standard uncertainty of each of the error's independent numbers [kg, m,
    kg·m²]; of static poses mass, r_CG and offsets [kg, m, N, N·m]."""
    signed: bool = False
    """Whether the change is a bias of known sign, which counts as a standard uncertainty."""

    @property
    def parameters(self) -> Float[np.ndarray, "10"]:
        """Standard uncertainty of the ten parameters by the error; a signed one's change [kg, m, kg·m²]."""
        return self.changes[:, 0] if self.signed else np.linalg.norm(self.changes, axis=1)

    @property
    def inertia(self) -> Float[np.ndarray, "6"]:
        """Part of the packed tensor in ``parameters`` [kg·m²]."""
        return self.parameters[4:]


class Gap(NamedTuple):
    """The undeclared error with the largest share in the variance of one parameter."""

    effect: Effect
    parameter: int
    """Index among the ten parameters."""
    share: float
    """Part of the parameter's variance, declared and undeclared errors together."""

    @property
    def text(self) -> str:
        """The gap in words."""
        return (
            f"undeclared: {self.effect.text}, at a typical {self.effect.figure}, is {100 * self.share:.0f} % of u² of "
            f"{QUANTITIES[self.parameter][0]} with undeclared errors: declare it, or write your figure in [undeclared]"
        )


@dataclass(frozen=True)
class Undeclared:
    """Errors that a result's coverage interval leaves out and its conventional bound holds."""

    effects: tuple[Effect, ...] = ()

    @property
    def covariance(self) -> Float[np.ndarray, "10 10"]:
        """Covariance of mass, r_CG and tensor by all of them."""
        return np.sum([effect.changes @ effect.changes.T for effect in self.effects], axis=0) + np.zeros((10, 10))

    @property
    def standard_uncertainty(self) -> Float[np.ndarray, "10"]:
        """Standard uncertainty of mass, r_CG and tensor by all of them [kg, m, kg·m²]."""
        return np.sqrt(np.diag(self.covariance))

    def share(self, u: Float[np.ndarray, "10"]) -> tuple[float, int]:
        """Return the largest standard uncertainty over u, and which of the ten parameters that is.

        Args:
            u: standard uncertainty of mass, r_CG and tensor without them [kg, m, kg·m²]; zero or not finite: the
                parameter is stated or not known, and does not count.
        """
        counted = (u > 0) & np.isfinite(u)
        ratio = np.divide(self.standard_uncertainty, u, out=np.zeros(10), where=counted)
        worst = int(np.argmax(ratio))
        return float(ratio[worst]), worst

    def largest(self, u: Float[np.ndarray, "10"]) -> Gap | None:
        """Return the error with the largest share in the variance of a parameter that is uncertain without it.

        Args:
            u: as for :meth:`share`; None is returned where no error adds to a parameter with u above zero.
        """
        total = np.where(u > 0, u**2 + np.diag(self.covariance), np.inf)
        shares = [effect.parameters**2 / total for effect in self.effects]
        if not np.any(shares):
            return None
        row, parameter = np.unravel_index(np.argmax(shares), (len(shares), 10))
        return Gap(effect=self.effects[row], parameter=int(parameter), share=float(shares[row][parameter]))

    def half_width(self, half: Float[np.ndarray, "10"]) -> Float[np.ndarray, "10"]:
        """Return half of the conventional bounds from half of the coverage intervals of 95 %: squares add."""
        return np.hypot(half, CONVENTIONAL * self.standard_uncertainty)

    def bounds(
        self, values: Float[np.ndarray, "10"], intervals: Float[np.ndarray, "10 2"]
    ) -> Float[np.ndarray, "10 2"]:
        """Return the conventional bounds of mass, r_CG and tensor: each arm of the coverage intervals, widened.

        Args:
            values: of the ten parameters.
            intervals: their coverage intervals; infinite or NaN ends stay so.
        """
        arms = np.abs(intervals - values[:, None])
        return values[:, None] + np.hypot(arms, CONVENTIONAL * self.standard_uncertainty[:, None]) * [-1, 1]

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

"""A statement of conformity with limits, by a decision rule that takes the uncertainty into account.

ISO/IEC 17025:2017, 7.8.6, asks for the specification, the rule, and to which figures they apply; JCGM 106:2012
(doi:10.59161/JCGM106-2012), clauses 8.2 and 8.3, defines the rules.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
import scipy

from rig.toml_tables import TomlTable, WrongKeyError
from uq.files.schema import Component, interval

Rule = Literal["simple", "guarded"]
Outcome = Literal["conforms", "does not conform", "undecided"]
RULES: Mapping[Rule, str] = {
    "simple": "simple acceptance: the value lies within the limits, whatever its uncertainty (JCGM 106, 8.2)",
    "guarded": "guarded acceptance: the value lies within the limits by at least the half-width of its conventional "
    "bound, which is U where no error is undeclared; it does not conform where it lies outside them by more (JCGM 106, "
    "8.3)",
}


class Conformity(TomlTable, frozen=True, kw_only=True):
    """``[report.conformity]``: limits of components, and the decision rule."""

    specification: str
    """Document that states the limits."""
    rule: Rule
    """Decision rule: how the uncertainty is taken into account (JCGM 106, 8.2 and 8.3)."""
    limits: Mapping[Component, Annotated[tuple[float, float], interval("kg*m^2")]]
    """Least and largest value of components [kg·m²]."""

    def __post_init__(self) -> None:
        """Refuse a statement without limits."""
        if not self.limits:
            raise WrongKeyError("limits", f"name one or more of {', '.join(get_args(Component))}")


@dataclass(frozen=True)
class Decision:
    """Decision of the rule on one component."""

    component: str
    limits: tuple[float, float]
    outcome: Outcome
    probability: float
    """Probability that the component lies within the limits, from a normal distribution."""


def decide(
    conformity: Conformity, inertia: np.ndarray, standard_uncertainty: np.ndarray, half_width: np.ndarray
) -> list[Decision]:
    """Return what the rule says of each component with limits.

    Args:
        conformity: limits and rule.
        inertia: packed tensor [kg·m²].
        standard_uncertainty: of its components [kg·m²].
        half_width: of their conventional bounds [kg·m²].
    """
    scale = np.maximum(standard_uncertainty, 1e-300)
    decisions = []
    for k, name in enumerate(get_args(Component)):
        if name in conformity.limits:
            low, high = conformity.limits[name]
            below, up_to_high = scipy.special.ndtr((np.array([low, high]) - inertia[k]) / scale[k])
            outcome = _outcome(conformity.rule, inertia[k], half_width[k], low, high)
            decisions.append(Decision(name, (low, high), outcome, probability=float(up_to_high - below)))
    return decisions


def _outcome(rule: Rule, value: float, expanded: float, low: float, high: float) -> Outcome:
    if not np.isfinite(expanded):
        return "undecided"
    guard = expanded if rule == "guarded" else 0.0
    if low + guard <= value <= high - guard:
        return "conforms"
    if not low - guard <= value <= high + guard:
        return "does not conform"
    return "undecided"

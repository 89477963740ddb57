"""A statement of conformity with limits, by a decision rule that takes the uncertainty into account.

ISO/IEC 17025:2017, 7.8.6, asks for the specification, the rule, and to which figures they apply; JCGM 106:2012
(doi:10.59161/JCGM106-2012), clauses 8.2 and 8.3, defines the rules.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import scipy

from identify.rigid_body.inertia import COMPONENTS
from uq.files.document import ExperimentError, Table

Rule = Literal["simple", "guarded"]
Outcome = Literal["conforms", "does not conform", "undecided"]
RULES: Mapping[Rule, str] = {
    "simple": "simple acceptance: the value lies within the limits, whatever its uncertainty (JCGM 106, 8.2)",
    "guarded": "guarded acceptance: the value lies within the limits by at least the expanded uncertainty U; it does "
    "not conform where it lies outside them by more than U (JCGM 106, 8.3)",
}


@dataclass(frozen=True)
class Conformity:
    """Limits, and how to decide."""

    specification: str
    rule: Rule
    limits: Mapping[str, tuple[float, float]]
    """Least and largest value of components [kg·m²]."""


@dataclass(frozen=True)
class Decision:
    """What the rule says of a component."""

    component: str
    limits: tuple[float, float]
    outcome: Outcome
    probability: float
    """That the component lies within the limits, from a normal distribution."""


def parse_conformity(table: Table) -> Conformity:
    """Return the table ``[report.conformity]``.

    Raises:
        ExperimentError: a key is missing or unknown, there are no limits, or they are the wrong way round.
    """
    specification, rule = table.typed("specification", str), table.choice("rule", get_args(Rule))
    limits = table.table("limits", _limits)
    table.finish()
    return Conformity(specification, rule, limits)


def _limits(table: Table) -> dict[str, tuple[float, float]]:
    found = {}
    for name in COMPONENTS:
        if name in table.content:
            ends = table.vector(name, "kg*m^2", size=2)
            if ends[0] >= ends[1]:
                raise ExperimentError(f"{table.path(name)} is {table.content[name]!r}: write the lower limit first")
            found[name] = (float(ends[0]), float(ends[1]))
        table.used.add(name)
    table.finish()
    if not found:
        raise ExperimentError(f"no limits in {table.where}: name one or more of {', '.join(COMPONENTS)}")
    return found


def decide(
    conformity: Conformity, inertia: np.ndarray, standard_uncertainty: np.ndarray, expanded: np.ndarray
) -> list[Decision]:
    """Return what the rule says of each component with limits.

    Args:
        conformity: limits and rule.
        inertia: packed tensor [kg·m²].
        standard_uncertainty: of its components [kg·m²].
        expanded: their expanded uncertainty U [kg·m²].
    """
    return [
        Decision(
            name, (low, high), _outcome(conformity.rule, inertia[k], expanded[k], low, high),
            float(np.diff(scipy.stats.norm.cdf([low, high], inertia[k], max(standard_uncertainty[k], 1e-300)))[0]),
        )
        for k, name in enumerate(COMPONENTS) if name in conformity.limits
        for low, high in [conformity.limits[name]]
    ]  # fmt: skip


def _outcome(rule: Rule, value: float, expanded: float, low: float, high: float) -> Outcome:
    if not np.isfinite(expanded):
        return "undecided"
    guard = expanded if rule == "guarded" else 0.0
    if low + guard <= value <= high - guard:
        return "conforms"
    if not low - guard <= value <= high + guard:
        return "does not conform"
    return "undecided"

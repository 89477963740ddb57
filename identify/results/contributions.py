"""Contributions to an identified tensor's uncertainty."""

from collections.abc import Mapping
from typing import Any

import numpy as np

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

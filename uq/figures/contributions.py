"""What an identified tensor's uncertainty is made of, and its figure."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.text_tables import decimals, fixed
from uq.campaign.campaign import GRAM_METRE
from uq.figures.campaign_figures import HATCHES, PAGE, PALETTE, STYLE, display_name

RESIDUALS, SCATTER, CG = "residuals", "scatter between runs", "r_cg"


def contributions(result: Identification) -> Mapping[str, np.ndarray]:
    """Return each part's contribution to the standard uncertainty of the components [kg·m²]; empty if not known.

    The budget of the declared sources where there is one; else residuals, scatter and centre of gravity.
    """
    if result.budget is not None:
        return {**result.budget, **_fixture(result)}
    said = result.diagnostics
    if "standard_uncertainty_from_residuals" not in said or "standard_uncertainty_from_cg" not in said:
        return {}
    residual, ratio = np.array(said["standard_uncertainty_from_residuals"]), np.array(said["scatter_between_runs"])
    beyond = residual * np.sqrt(np.maximum(ratio**2 - 1, 0))
    parts = {RESIDUALS: residual, SCATTER: beyond, CG: np.array(said["standard_uncertainty_from_cg"])}
    return {name: values for name, values in parts.items() if values.any()}


def _fixture(result: Identification) -> dict[str, np.ndarray]:
    """What taking a fixture off adds to the standard uncertainty of all that stood on the load cell."""
    if result.tare is None:
        return {}
    whole = result.tare.whole.standard_uncertainty[4:]
    return {"fixture taken off": np.sqrt(np.maximum(result.standard_uncertainty**2 - whole**2, 0))}


def evaluated(name: str) -> str:
    """Return the type of evaluation of a part (GUM 4.2, 4.3): A from the data, B declared."""
    return "A" if name == RESIDUALS or name.startswith("scatter between") else "B"


def shares(parts: Mapping[str, np.ndarray], standard_uncertainty: np.ndarray) -> Figure:
    """Draw each part's share of the parts' variances together, with the standard uncertainty beside it.

    Args:
        parts: contributions to the standard uncertainty by name [kg·m²], each of six components.
        standard_uncertainty: the combined one of each component [kg·m²].
    """
    variances = np.nan_to_num([np.square(values) for values in parts.values()], posinf=0.0)
    total = variances.sum(axis=0)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(PAGE, 2.4), layout="constrained")
        axes = figure.subplots()
        base = np.zeros(len(COMPONENTS))
        for k, (name, variance) in enumerate(zip(parts, variances, strict=True)):
            width = 100 * variance / np.maximum(total, 1e-300)
            colour, hatch = PALETTE[1:][k % 7], HATCHES[k // 7 % len(HATCHES)]
            axes.barh(range(6), width, 0.72, left=base, color=colour, hatch=hatch, edgecolor="white", linewidth=0.3,
                      label=display_name(name).replace("$", r"\$"))  # fmt: skip
            base = base + width
        for k, value in enumerate(GRAM_METRE * standard_uncertainty):
            axes.annotate(
                f"u = {fixed(value, decimals(value))} g·m²", (100, k), (4, 0), textcoords="offset points", va="center"
            )
        axes.set_yticks(range(6), COMPONENTS)
        axes.invert_yaxis()
        axes.set(xlim=(0, 100), xlabel="share of the variance [%]")
        axes.tick_params(axis="y", length=0)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return figure

"""A live estimate in words: a block of lines for a terminal, one line elsewhere."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.display.rounding import significant, with_uncertainty
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.runs.live.live_estimate import LiveEstimate

MOST_WARNINGS = 3


def block_of(estimate: LiveEstimate, target: float | None, warnings: Sequence[str]) -> list[str]:
    """Return the tensor with its standard uncertainty and interval, a line per component; target; warnings."""
    lines = [f"{f'{estimate.seconds:.0f} s of motion, g·m²':<29}95 %"]
    if estimate.undetermined:
        lines = [_undetermined(estimate)]
    else:
        for k, name in enumerate(COMPONENTS):
            value = with_uncertainty(GRAM_METRE * estimate.inertia[k], GRAM_METRE * estimate.standard_uncertainty[k])
            half = GRAM_METRE * estimate.half_width[k]
            lines.append(f"  {name}  {value:<20} ± {significant(half, 2)}{_share(estimate, k)}")
    if target is not None and not estimate.undetermined:
        lines.append(about_target(estimate, target))
    return [*lines, *(f"warning: {text}" for text in list(warnings)[:MOST_WARNINGS])]


def line_of(estimate: LiveEstimate, target: float | None) -> str:
    """Return the same in one line."""
    if estimate.undetermined:
        return _undetermined(estimate)
    pairs = zip(COMPONENTS, estimate.inertia, estimate.standard_uncertainty, strict=True)
    values = ", ".join(f"{name} {with_uncertainty(GRAM_METRE * v, GRAM_METRE * u)}" for name, v, u in pairs)
    aim = "" if target is None else f"; {about_target(estimate, target)}"
    return f"{estimate.seconds:.0f} s of motion: {values} g·m²{aim}"


def about_target(estimate: LiveEstimate, target: float) -> str:
    """Return how far the target is, or what forbids it; and what undeclared errors add where they exceed it."""
    return f"{_reach(estimate, target)}{_floor(estimate, target)}"


def missed(interval95: Float[np.ndarray, "6 2"], target: float, contradicted: str = "") -> str:
    """Return a line where an identification misses a target that the live estimate had reached; else "".

    Args:
        interval95: of its components [kg·m²].
        target: half the interval that every component was to have at most [kg·m²].
        contradicted: clause on what the run contradicts, where it does: then no interval holds.
    """
    half = np.ptp(interval95, axis=1) / 2
    worst = int(np.argmax(half))
    if half[worst] <= target and not contradicted:
        return ""
    wanted, largest = (significant(GRAM_METRE * x, 2) for x in (target, half[worst]))
    why = f"{COMPONENTS[worst]} has ± {largest}; record for longer, or follow the warnings below"
    return (
        f"the target ± {wanted} g·m² at 95 %, which the estimate while recording had reached, is missed by this result "
        f"of the whole recording: {contradicted or why}"
    )


def _floor(estimate: LiveEstimate, target: float) -> str:
    k = int(np.argmax(estimate.undeclared))
    if not estimate.undeclared[k] > target:
        return ""
    half = significant(GRAM_METRE * estimate.undeclared[k], 2)
    return f"; undeclared errors at typical size add at least ± {half} to {COMPONENTS[k]} at any time"


def _reach(estimate: LiveEstimate, target: float) -> str:
    worst = int(np.argmax(estimate.half_width))
    largest = f"{COMPONENTS[worst]} has ± {significant(GRAM_METRE * estimate.half_width[worst], 2)}"
    wanted = f"target ± {significant(GRAM_METRE * target, 2)} g·m² at 95 %"
    forbids = estimate.forbids(target)
    if forbids is not None:
        source, name, half_width = forbids
        return (
            f"{wanted}: no duration reaches it: the declared sources, {source} above all, leave ± "
            f"{significant(GRAM_METRE * half_width, 2)} of {name}"
        )
    if estimate.half_width[worst] <= target:
        return f"{wanted}: reached, {largest}"
    seconds = estimate.seconds_to(target)
    return f"{wanted}: {largest}, about {math.ceil(seconds)} s more"


def _share(estimate: LiveEstimate, k: int) -> str:
    """The declared source that contributes most, where sources matter more than noise."""
    if not estimate.of_sources[k] > estimate.type_a[k]:
        return ""
    return f"    ± {significant(GRAM_METRE * estimate.of_sources[k], 2)} from {estimate.largest_source[k]} and others"


def _undetermined(estimate: LiveEstimate) -> str:
    names = ", ".join(estimate.undetermined)
    return f"{estimate.seconds:.0f} s of motion: it does not yet determine {names}"

"""The view of 3σ over that of a reference, from the same draws."""

from identify.display.reporting import uncaptioned
from identify.display.rounding import with_uncertainty
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS
from uq.monte_carlo.campaign.spread_ratio import FACTOR, LEVEL, SpreadComparison


def title(result: SpreadComparison) -> str:
    """Return what is compared with what."""
    return f"3σ over that of {result.reference}, from the same {result.trials:,} draws"


def tables(result: SpreadComparison) -> list[Table]:
    """Return ratio and verdict of each case, by component."""
    rows = []
    for names, ratio in result.ratios.items():
        figures = zip(ratio.value, ratio.standard_error, strict=True)
        rows.append([*names, "ratio", *(with_uncertainty(value, error) for value, error in figures)])
        rows.append([*[""] * len(names), "differs", *("yes" if differs else "no" for differs in ratio.differs)])
    return [Table(title(result), [*result.heads, "", *COMPONENTS], rows, NOTE)]


def overview(result: SpreadComparison) -> list[Table]:
    """Return the table below its title."""
    return uncaptioned(result)


NOTE = (
    f"After ± the standard error, by pairs of trials. differs: the ratio is not 1, by {FACTOR:.2f} standard errors or "
    f"more: at {100 * LEVEL:g} % for the six together."
)

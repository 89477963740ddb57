"""The views of a sweep, 3σ and mean error of all sources by value in g·m², and of 3σ over that of a reference."""

from collections.abc import Iterator

from identify.display.reporting import Drawing, Section, section_of, stem, uncaptioned
from identify.display.rounding import with_uncertainty
from identify.display.text_tables import Table, counted
from identify.rigid_body.inertia import COMPONENTS
from uq.monte_carlo.campaign.spread_ratio import FACTOR, LEVEL, SpreadComparison
from uq.monte_carlo.campaign.statistics import large_mean_error
from uq.monte_carlo.campaign.sweep import SweepResult
from uq.report.assumptions import source_assumptions
from uq.report.drawing import drawing
from uq.report.tables import campaign as campaign_view
from uq.report.tables.cases import PAIR, case_table, rows_of, verdict_of_biased


def title(result: SweepResult) -> str:
    """Return what the tables are of."""
    first = next(iter(result.campaigns.values()))
    return f"Sweep, {counted(first.trials, 'trial')} a value, seed {first.seed}"


def tables(result: SweepResult) -> list[Table]:
    """Return mean error and 3σ by value, of each trajectory with each estimator."""
    cases = [
        ((*key, *pair), rows_of(campaign[pair].total))
        for key, campaign in result.campaigns.items()
        for pair in campaign.pairs()
    ]
    return [case_table("Mean error and 3σ by value", [*result.values, *PAIR], cases)]


def section(result: SweepResult) -> Section:
    """Return its part of a report."""
    first, biased = next(iter(result.campaigns.values())), _biased(result)
    count = len(result.campaigns)
    beyond = f"of {count} values."
    where = [f"{', '.join(pair)}: the mean error exceeds 3σ at {n} {beyond}" for pair, n in biased.items() if n]
    return section_of(
        result, computed=[campaign_view.computed(first), campaign_view.INDEX], findings=[*where, *result.warnings],
        assumptions=[*campaign_view.METHOD, *source_assumptions(result.provenance)],
        verdict=verdict_of_biased({pair: bool(n) for pair, n in biased.items()}),
    )  # fmt: skip


def _biased(result: SweepResult) -> dict[tuple[str, str], int]:
    """Number of values at which a mean error exceeds its 3σ, by trajectory and estimator."""
    campaigns = result.campaigns.values()
    pairs = next(iter(campaigns)).pairs()
    return {pair: sum(bool(large_mean_error("", campaign[pair].total)) for campaign in campaigns) for pair in pairs}


def drawings(result: SweepResult) -> list[Drawing]:
    """Return a figure for each trajectory with each estimator, where one key was swept."""
    return list(_drawings(result)) if len(result.values) == 1 else []


def _drawings(result: SweepResult) -> Iterator[Drawing]:
    (key,) = result.values
    for trajectory, estimator in next(iter(result.campaigns.values())).pairs():
        yield drawing(
            stem("sweep", trajectory, estimator),
            f"3σ and mean error of {', '.join(COMPONENTS)} against {key}, {trajectory}, {estimator}; bands: two "
            "standard errors either way",
            "sweep.against_value", result, trajectory, estimator,
        )  # fmt: skip


def spread_title(result: SpreadComparison) -> str:
    """Return what is compared with what."""
    return f"3σ over that of {result.reference}, from the same {result.trials:,} draws"


def spread_tables(result: SpreadComparison) -> list[Table]:
    """Return ratio and verdict of each case, by component."""
    rows = []
    for names, ratio in result.ratios.items():
        figures = zip(ratio.value, ratio.standard_error, strict=True)
        rows.append([*names, "ratio", *(with_uncertainty(value, error) for value, error in figures)])
        rows.append([*[""] * len(names), "differs", *("yes" if differs else "no" for differs in ratio.differs)])
    return [Table(spread_title(result), [*result.heads, "", *COMPONENTS], rows, SPREAD_NOTE)]


def spread_overview(result: SpreadComparison) -> list[Table]:
    """Return the table below its title."""
    return uncaptioned(result)


SPREAD_NOTE = (
    f"After ± the standard error, by pairs of trials. differs: the ratio is not 1, by {FACTOR:.2f} standard errors or "
    f"more: at {100 * LEVEL:g} % for the six together."
)

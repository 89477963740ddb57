"""The view of a sweep: 3σ and mean error of all sources together, by value; in g·m²."""

from collections.abc import Iterator

from identify.display.reporting import Drawing, stem
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS
from uq.monte_carlo.campaign.sweep import SweepResult
from uq.report.drawing import drawing
from uq.report.tables.cases import PAIR, case_table, rows_of


def title(result: SweepResult) -> str:
    """Return what the tables are of."""
    first = next(iter(result.campaigns.values()))
    return f"Sweep, {first.trials:,} trials a value, seed {first.seed}"


def tables(result: SweepResult) -> list[Table]:
    """Return mean error and 3σ by value, of each trajectory with each estimator."""
    cases = [
        ((*key, *pair), rows_of(campaign[pair].total))
        for key, campaign in result.campaigns.items()
        for pair in campaign.pairs()
    ]
    return [case_table("Mean error and 3σ by value", [*result.values, *PAIR], cases)]


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

"""The view of an achieved motion: how each axis followed its plan, and the uncertainty of what was run."""

from identify.reporting import Drawing, Section, section_of, uncaptioned
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import common, fixed, significant, with_uncertainty
from identify.text_tables import Table, one_line, sentence
from uq.planning.required_duration import average
from uq.planning.sensor_worth import BOTH
from uq.report.drawing import drawing
from uq.report.input_tables import source_tables
from uq.tracking.achieved_motion import Achieved
from uq.tracking.centre_stillness import SLOWEST


def title(result: Achieved) -> str:
    """Return which run stands beside which plan."""
    return one_line(f"{result.run} beside {result.trajectory}")


def tables(result: Achieved) -> list[Table]:
    """Return how each axis followed, predicted 3σ, and how still the centre of gravity was."""
    return [_axes(result), _widths(result), *_stillness(result)]


overview = uncaptioned


def notes(result: Achieved) -> list[str]:
    """Return the averages and the warnings, a line each."""
    return [_summary(result), *(f"attention: {text}" for text in result.warnings)]


def drawings(result: Achieved) -> list[Drawing]:
    """Return planned and measured angular velocity over some seconds."""
    return [drawing("followed", "Some seconds from the middle of the motion.", "recordings.followed", *result.trace)]


def section(result: Achieved) -> Section:
    """Return its part of a report."""
    return section_of(
        result, title=f"What was run: {result.run} beside {result.trajectory}",
        computed=[sentence(_summary(result)), FOLLOWED], details=source_tables(result.provenance),
        assumptions=["The displacement of the platform's centre was that of the plan; the attitude follows the gyro."],
    )  # fmt: skip


def _summary(result: Achieved) -> str:
    """The averages in one line."""
    averages = []
    for goal in BOTH:
        achieved, planned = (GRAM_METRE * average(s, goal) for s in (result.three_sigma, result.planned_three_sigma))
        averages.append(f"{goal} {significant(achieved)} g·m² (planned {significant(planned)})")
    return f"average 3σ of what was run: {', '.join(averages)}"


def _axes(result: Achieved) -> Table:
    """Amplitude, lag, offset and residual of each axis."""
    f = result.followed
    gains = map(with_uncertainty, f.gain, f.gain_standard_error)
    lags = map(with_uncertainty, 1e3 * f.lag, 1e3 * f.lag_standard_error)
    columns = zip(gains, lags, common(1e3 * f.offset), common(1e3 * f.residual), strict=True)
    rows = [[f"ω{k}", *cells] for k, cells in enumerate(columns, start=1)]
    head = ["axis", "amplitude / planned", "lag, ms", "offset, mrad/s", "residual rms, mrad/s"]
    return Table("How each axis followed", head, rows, LAG)


def _widths(result: Achieved) -> Table:
    """Predicted 3σ of the plan and of what was run, by component."""
    change = 100 * (result.three_sigma / result.planned_three_sigma - 1)
    rows = [
        ["planned", *(significant(GRAM_METRE * x, 4) for x in result.planned_three_sigma)],
        ["what was run", *(significant(GRAM_METRE * x, 4) for x in result.three_sigma)],
        ["change, %", *(fixed(x, 1) for x in change)],
    ]
    return Table("Predicted 3σ, g·m²", ["3σ, g·m²", *COMPONENTS], rows, PREDICTED)


def _stillness(result: Achieved) -> list[Table]:
    """Acceleration and displacement of the centre of gravity, where mass and centre of gravity are stated."""
    still = result.stillness
    if still is None:
        return []
    rows = [
        ["acceleration, mm/s²", significant(1e3 * still.acceleration)],
        ["planned, mm/s²", significant(1e3 * still.planned)],
        ["measured less planned, mm/s²", significant(1e3 * still.apart)],
        [f"displacement at {SLOWEST:g} Hz and above, mm", significant(1e3 * still.displacement)],
    ]
    note = f"By the {still.by}, from {SLOWEST:g} Hz to the motion's band."
    return [Table("How still the centre of gravity was", ["centre of gravity, rms", "value"], rows, note)]


FOLLOWED = "The run's angular velocity is fitted by the planned one: amplitude, lag, and offset of each axis."
LAG = "lag: counted from the run's first sample; ± is a standard error, from the residuals."
PREDICTED = "By the law of propagation, the measured angular velocity in place of the planned one."

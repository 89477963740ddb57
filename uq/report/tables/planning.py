"""The views of a plan: which sensor is worth improving, and how long a target takes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.display.reporting import Drawing, Section, section_of
from identify.display.rounding import exact, fixed, significant
from identify.display.text_tables import Table, sentence
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.plan.measurement.measurement_plan import MeasurementPlan
from uq.plan.measurement.required_duration import Duration, average
from uq.plan.measurement.sensor_worth import BOTH, NEGLIGIBLE, SensorWorth
from uq.report.assumptions import source_assumptions
from uq.report.drawing import drawing
from uq.report.input_tables import source_tables


def title(plan: MeasurementPlan) -> str:
    """Return the answers, a line each: what is now, what is worth most, and how long each target takes."""
    sensors, seconds = plan.sensors, plan.durations[0].current_duration
    now = " and ".join(f"{_average(sensors.three_sigma, goal)} g·m² ({goal})" for goal in BOTH)
    best = sensors.sources.index(sensors.best)
    changes = " and ".join(
        f"{_average(sensors.halved[best], goal)} g·m² ({goal}, {signed_tenth(100 * change)} %)"
        for goal, change in zip(BOTH, sensors.changes()[best], strict=True)
    )
    where = f"{sensors.trajectory} of {seconds:g} s, {sensors.estimator}"
    answers = [
        f"Average 3σ now ({where}): {now}.",
        f"Worth most: {sensors.best.replace('_', ' ')}. With half of it, {changes}.",
        *(sentence(duration.title()) for duration in plan.durations),
    ]
    return "\n".join(answers)


def tables(plan: MeasurementPlan) -> list[Table]:
    """Return what halving each source is worth on average, and what each target takes."""
    (sensors,) = plan.sensors.overview()
    caption = "Which sensor is worth improving?"
    return [replace(sensors, caption=caption, note=SENSOR_NOTE), duration_table(plan.durations)]


def overview(plan: MeasurementPlan) -> list[Table]:
    """Return the first alone: the answers above it say how long."""
    return plan.sensors.overview()


def notes(plan: MeasurementPlan) -> list[str]:
    """Return remarks and warnings, a line each."""
    return [*plan.sensors.notes(), *(f"attention: {text}" for text in plan.warnings)]


def drawings(plan: MeasurementPlan) -> list[Drawing]:
    """Return the average 3σ over the duration."""
    return [duration_drawing(plan.durations)]


def duration_drawing(durations: Sequence[Duration]) -> Drawing:
    """Return the figure of durations that targets take, all of one growth."""
    asked: dict[str, list[float]] = {}
    for duration in durations:
        asked.setdefault(duration.goal, []).append(duration.target)
    return drawing("durations", DURATIONS, "duration.duration_figure", durations[0].growth, asked)


def section(plan: MeasurementPlan) -> Section:
    """Return its part of a report."""
    now, best, *duration_lines = title(plan).splitlines()
    pairs = list(zip(duration_lines, plan.durations, strict=True))
    reachable, forbidden = ([text for text, d in pairs if d.reachable is reached] for reached in (True, False))
    (by_component,) = plan.sensors.tables()
    by_component = replace(by_component, caption="Each source halved, by component", note=DERIVATIVE_NOTE)
    return section_of(
        plan, title="Plan of a measurement", computed=[now, *reachable, COMPUTED],
        findings=[*plan.warnings, *forbidden, *plan.sensors.remarks],
        details=[by_component, *source_tables(plan.provenance)],
        assumptions=[ASSUMPTION, *source_assumptions(plan.provenance)], verdict=best, headline=2,
    )  # fmt: skip


def worth_tables(worth: SensorWorth) -> list[Table]:
    """Return what halving each source's sigma does, most worth first: averages, their changes, derivatives."""
    head = ["sigma halved", "moments, g·m²", "change, %", "products, g·m²", "change, %", *COMPONENTS]
    none, changes = ["none"], worth.changes()
    for goal in BOTH:
        none += [significant(GRAM_METRE * average(worth.three_sigma, goal)), ""]
    rows = [[*none, *("" for _ in COMPONENTS)]]
    for k in worth.by_worth:
        cells = [worth.sources[k].replace("_", " ")]
        for goal, change in zip(BOTH, changes[k], strict=True):
            cells += [significant(GRAM_METRE * average(worth.halved[k], goal)), signed_tenth(100 * change)]
        rows.append([*cells, *(fixed(value, 3) for value in worth.derivative[k])])
    return [Table("", head, rows)]


def worth_overview(worth: SensorWorth) -> list[Table]:
    """Return averages alone; sources that change neither by 0.05 % share a row."""
    (table,) = worth_tables(worth)
    none, *rows = (row[:5] for row in table.rows)
    small = [abs(worth.changes()[k]).max() < NEGLIGIBLE for k in worth.by_worth]
    if sum(small) > 1:
        shown = [row for row, negligible in zip(rows, small, strict=True) if not negligible]
        rows = [*shown, [f"{sum(small)} others", "", "0.0", "", "0.0"]]
    return [Table("", table.head[:5], [none, *rows])]


def worth_notes(worth: SensorWorth) -> list[str]:
    """Return the remarks, a line each."""
    return [f"note: {text}" for text in worth.remarks]


def duration_title(duration: Duration) -> str:
    """Return what the target takes, in a sentence."""
    wanted = f"average 3σ of {_as_asked(duration.target)} g·m² ({duration.goal})"
    now = f"{significant(GRAM_METRE * duration.now, 4)} g·m² at {duration.current_duration:g} s"
    if duration.seconds is not None:
        how = "" if duration.checked else "; extrapolated, too long to be checked"
        return f"{wanted}: measure for {significant(duration.seconds, 4)} s (now {now}{how}){_floor(duration)}"
    return (
        f"{wanted}: no duration reaches it, {significant(GRAM_METRE * duration.reached, 4)} g·m² is the least; "
        f"{_words(duration.forbids)} forbids it, which time does not average (now {now}){_floor(duration)}"
    )


def _floor(duration: Duration) -> str:
    """Text on what undeclared errors leave, where the target lies below it."""
    if duration.target > duration.floor:
        return ""
    return f"; below the {significant(GRAM_METRE * duration.floor, 3)} g·m² that undeclared errors have at typical size"


def duration_tables(duration: Duration) -> list[Table]:
    """Return the target, the average 3σ as it is, and the duration."""
    return [duration_table([duration])]


def duration_overview(_: Duration) -> list[Table]:
    """Return nothing: the title says all."""
    return []


def duration_table(durations: Sequence[Duration]) -> Table:
    """Return what each of several targets takes."""
    rows = []
    for duration in durations:
        wanted = [duration.goal, _as_asked(duration.target), significant(GRAM_METRE * duration.now, 3)]
        if duration.seconds is None:
            least = f"{_words(duration.forbids)} leaves {significant(GRAM_METRE * duration.reached, 3)} g·m²"
            rows.append([*wanted, "–", f"out of reach: {least}"])
        else:
            rows.append([*wanted, significant(duration.seconds, 4), "" if duration.checked else "extrapolated"])
        rows[-1].insert(3, significant(GRAM_METRE * duration.floor, 3))
    head = ["average 3σ of", "target, g·m²", "now, g·m²", "undeclared, g·m²", "duration, s", "why"]
    return Table("How long must I measure?", head, rows, DURATION_NOTE)


def signed_tenth(value: float) -> str:
    """Return a change with its sign, to a tenth; what rounds to zero has a plus."""
    return f"{round(value, 1) + 0.0:+.1f}".replace("-", "−")


def _average(three_sigma: np.ndarray, goal: str) -> str:
    return significant(GRAM_METRE * average(three_sigma, goal), 3)


def _as_asked(target: float) -> str:
    """A target in g·m²."""
    return exact([GRAM_METRE * target])[0]


def _words(name: str | None) -> str:
    return (name or "").replace("_", " ")


DURATIONS = "Average 3σ over the duration; grey: the duration as it is; dotted: the targets."
DURATION_NOTE = (
    "Noise is averaged over time; what is drawn once, such as the centre of gravity's error, is not. Ramps and motion "
    "stay as they are; each duration is checked by the law at that duration."
)
COMPUTED = (
    "By the law of propagation with every declared source: 3σ is three standard deviations; an average is over three "
    f"moments or three products. {DURATION_NOTE}"
)
SENSOR_NOTE = "The average 3σ with this source's sigma halved, all others as they are."
DERIVATIVE_NOTE = (
    "By component: derivative of ln 3σ by ln sigma. 0.8 says that 1 % less of this sigma leaves 0.8 % less of the 3σ."
)
ASSUMPTION = "Every error source is as declared; the body is rigid and turns exactly as the trajectory says."

"""The views of designed motions, of a platform or an arm: what they promise, what limits them, their files."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from identify.display.reporting import Drawing, Section, section_of, uncaptioned
from identify.display.rounding import common, fixed, significant
from identify.display.text_tables import Table, sentence
from identify.motion.limit_peaks import Peak
from identify.results import measured_directions
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.plan.measurement.platform_run import effort_of, motion_at
from uq.plan.measurement.required_duration import average
from uq.plan.measurement.sensor_worth import BOTH
from uq.plan.motion_design.arm.arm_report import ArmDesignReport
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.hexapod.design import Design
from uq.plan.motion_design.hexapod.design_report import DesignReport
from uq.plan.motion_design.hexapod.designed_experiment import NAME
from uq.plan.motion_design.hexapod.motion_export import MEANING, MotionExport
from uq.plan.motion_design.motion_formats import formats
from uq.plan.motion_design.report import MotionReport
from uq.report.drawing import drawing
from uq.report.figures.platform_scene import FRAMES, Scene, scene
from uq.report.figures.style import AXIS_COLOURS
from uq.report.input_tables import source_tables
from uq.report.tables.cases import case_table
from uq.report.tables.planning import DERIVATIVE_NOTE, duration_drawing, duration_table

RULES = 0.5
"""Part of the variance from which on the load cell's noise, which alone the bound counts, makes the bound tell."""
SHOWN = 10.0
"""Length of the motion that figures show, from its middle [s]."""
PLAYED = 5.0
"""Length of the motion that the moving drawing plays [s]."""
RATE = 100.0
"""Rate of the instants that figures draw [Hz]."""


def platform_title(report: DesignReport) -> str:
    """Return what the design promises, and what limits it, a line each."""
    design = report.design
    sentences = [
        f"Average {WIDTHS[objective]} {_averages_in_words(report, objective)}, against the reference{end}"
        for objective, end in (("rms", "."), ("3sigma", ", by the law with every declared source."))
    ]
    if not design.improved:
        sentences.append("No design beat the reference: the reference itself is returned.")
    floors = {goal: average(3 * np.sqrt(report.durations[0].growth.undeclared), goal) for goal in BOTH}
    if any(floors.values()):
        words = " and ".join(f"{_figure(floor)} g·m² ({goal})" for goal, floor in floors.items())
        sentences.append(f"Undeclared errors at typical size have an average 3σ of {words}, at any duration.")
    names = sorted({peak.quantity.replace("_", " ") for peak in design.active})
    sentences.append(f"What limits it: {', '.join(names)}." if names else "No limit is used up.")
    return "\n".join([*sentences, *_bound_in_words(report)])


def platform_tables(report: DesignReport) -> list[Table]:
    """Return predicted 3σ, the use of each limit, what each sensor is worth, and durations."""
    limits = [_peak_cells(peak, f"{peak.channel + 1}") for peak in report.design.peaks]
    (sensors,) = report.sensors.tables()
    return [
        _trajectories(report),
        Table("What each limit is used to", ["limit", "leg or axis", "at, s", "used, %"], limits, PLATFORM_LIMIT_NOTE),
        replace(sensors, caption="Which sensor should I buy?", note=DERIVATIVE_NOTE),
        duration_table(report.durations),
    ]


platform_overview = uncaptioned


def platform_notes(report: DesignReport) -> list[str]:
    """Return the warnings, a line each, and where less of a source makes the 3σ larger."""
    return [*(f"attention: {text}" for text in report.warnings), *report.sensors.notes()]


def platform_drawings(report: DesignReport) -> list[Drawing]:
    """Return platform, motion, legs, coverage of the sphere, budgets and durations."""
    design, laws = report.design, report.laws
    motion, used = _shown(design)
    t = np.asarray(motion.t)
    omega, alpha = np.asarray(motion.twist.omega), np.asarray(motion.twist.alpha)
    visited = [f"{100 * measured_directions.visited(path):.0f} %" for path in (omega, alpha)]
    view = _scene(design, motion)
    played = f"{view.seconds:g} s of the motion, as fast and as large; {VIEW}"
    position = np.asarray(motion.pose.position) - np.asarray(design.experiment.platform.home)
    paths = {"ω [rad/s]": omega, "α [rad/s²]": alpha, "displacement [mm]": 1e3 * position}
    axes = {f"axis {k}": colour for k, colour in enumerate(AXIS_COLOURS, 1)}
    totals = {name: law.total for name, law in laws.items()}
    return [
        drawing("platform", played, "platform.still", view, animation="platform.moving"),
        drawing("motion", f"{t[-1] - t[0]:.0f} s from the middle.", "design.over_time", t, paths, axes),
        drawing("legs", LEGS, "design.legs", t, used, design.limits),
        drawing("coverage", COVERAGE.format(*visited), "sphere.coverage", omega, alpha, laws[NAME].total.covariance),
        drawing("components", COMPONENTS_OF, "campaign.contributions", totals),
        drawing("budgets", BUDGETS, "design.budgets", laws, report.bound),
        duration_drawing(report.durations),
    ]


def platform_section(report: DesignReport) -> Section:
    """Return its part of a report; 3σ by source and what each start led to follow the figures."""
    design = report.design
    stayed = "No design beat the reference within these limits: the reference is returned."
    exceeded = [f"A limit is exceeded: {peak}." for peak in design.peaks if peak.share > 1 + 1e-6]
    remarks = [*report.sensors.remarks, *([] if design.improved else [stayed]), *exceeded]
    relaxed = () if design.bound is None else design.bound.relaxes
    starts = [[f"{k}", f"{start.goal:.4f}", "yes" if start.met else "no"] for k, start in enumerate(design.starts, 1)]
    searches = Table("Searches", ["start", "goal, reference = 1", "limits met"], starts)
    return _section(
        report, PLATFORM_METHOD, title="The best experiment that a platform can run",
        findings=[*report.warnings, *remarks],
        details=[_sources(report), searches, *source_tables(report.provenance)],
        assumptions=[*PLATFORM_ASSUMPTIONS, *(f"The bound leaves out: {text}." for text in relaxed)],
    )  # fmt: skip


def arm_title(report: ArmDesignReport) -> str:
    """Return what the design promises, what limits it, and how the simulation went, a line each."""
    design, run = report.design, report.run
    least, random = (design.motions[name].averages for name in ("designed", "random"))
    moments, products = (
        f"{GRAM_METRE * least[what]:.3g} g·m² ({_change(least[what], random[what])} %)" for what in BOTH
    )
    floor = " and ".join(f"{GRAM_METRE * x:.3g} g·m²" for x in design.with_undeclared.averages.values())
    contact = f"{len(run.contacts)} contacts" if run.contacts else "no contact"
    follows = max(run.tracking_error.tolist())
    return (
        f"Average 3σ of the moments {moments} and of the products {products}, "
        f"against the best random series of the same {design.duration:g} s.\n"
        f"With undeclared errors of the load cell at typical size: {floor}.\n"
        f"Most used: {design.designed.peaks[0]}.\n"
        f"Simulated in MuJoCo: joints within {follows:.2g} rad or m of their command, {contact}."
    )


def arm_tables(report: ArmDesignReport) -> list[Table]:
    """Return predicted 3σ of each motion, the use of each limit, and how the simulated joints follow."""
    design, run, arm = report.design, report.run, report.design.limits.arm
    motions = []
    for name, candidate in (design.motions | {"with_undeclared": design.with_undeclared}).items():
        mass, *r_cg_and_tensor = GRAM_METRE * candidate.expanded
        averages = [GRAM_METRE * x for x in candidate.averages.values()]
        values = (mass, max(r_cg_and_tensor[:3]), *r_cg_and_tensor[3:], *averages)
        motions.append([NAMES[name], *(f"{x:.3g}" for x in values)])
    head = ["3σ", "mass, g", "r_CG, mm", *(f"{name}, g·m²" for name in COMPONENTS), *BOTH]
    ran = {peak.quantity: f"{100 * peak.share:.1f}" for peak in run.peaks}
    limits = [[*_peak_cells(peak, peak.where), ran.get(peak.quantity, "–")] for peak in design.designed.peaks]
    errors = [
        [name, f"{1e3 * error:.3g} {'mm' if slides else 'mrad'}"]
        for name, error, slides in zip(arm.names, run.tracking_error, arm.chain.prismatic, strict=True)
    ]
    return [
        Table("Predicted 3σ of each motion", head, motions, MOTION_NOTE),
        Table("What each limit is used to", ["limit", "where", "at, s", "used, %", "simulated, %"], limits, LIMIT_NOTE),
        Table("Largest distance of the simulated joints from their command", ["joint", "error"], errors),
    ]


arm_overview = uncaptioned


def arm_drawings(report: ArmDesignReport) -> list[Drawing]:
    """Return the joints' positions and speeds over the run."""
    return [drawing("joints", "The joints' positions and speeds, as commanded.", "design.joints", report.design)]


def arm_section(report: ArmDesignReport) -> Section:
    """Return its part of a report."""
    return _section(
        report, ARM_METHOD, title="The best motion that an arm can run", details=source_tables(report.provenance),
        assumptions=ARM_ASSUMPTIONS,
    )  # fmt: skip


def design_tables(design: Design) -> list[Table]:
    """Return predicted 3σ and mean error of each component, of the design and of the reference, in g·m²."""
    figures = {
        "3σ, designed": design.expanded, "mean error, designed": design.mean_error,
        "3σ, reference": design.reference.expanded, "mean error, reference": design.reference.mean_error,
    }  # fmt: skip
    return [case_table("", (), [((), [[name, *map(_figure, values)] for name, values in figures.items()])])]


def export_tables(export: MotionExport) -> list[Table]:
    """Return each file of an exported motion, what it is, and how far it is from the motion."""
    differences = export.differences
    what = {motion_format.ending: motion_format.description for motion_format in formats(PlatformCommand)}
    what["json"] = "columns, units, rotation order, signs"
    rows = [
        [name, what[name.partition(".")[2]], f"{differences[name]:.1e}" if name in differences else "–"]
        for name in export.contents
    ]
    return [Table(_exported(export), ["file", "what", "off by, m or rad"], rows, FILES)]


export_overview = uncaptioned


def export_section(export: MotionExport) -> Section:
    """Return its part of a report."""
    meaning = [sentence(text) for text in (MEANING["frames"], MEANING["rotation"])]
    return Section(_exported(export), details=export_tables(export), assumptions=meaning, provenance=export.provenance)


def _exported(export: MotionExport) -> str:
    shares = f"{100 * export.speed:g} % of the speed, {100 * export.amplitude:g} % of the amplitude"
    rehearsal = "" if export.speed == export.amplitude == 1 else f"; rehearsal at {shares}"
    return f"Exported motion, {export.seconds:.4g} s{rehearsal}"


def _section(report: MotionReport, method: str, **parts: Any) -> Section:
    """The part of a page of a designed motion: the first line of the title is its verdict."""
    verdict, *others = report.title().splitlines()
    return section_of(report, computed=[*others, method], verdict=verdict, **parts)


def _peak_cells(peak: Peak, where: str) -> list[str]:
    """A row of a table of limits: which limit is used where, when [s], and how much of it [%]."""
    return [peak.quantity.replace("_", " "), where, fixed(peak.t, 3), fixed(100 * peak.share, 1)]


def _trajectories(report: DesignReport) -> Table:
    """3σ, mean error and both together by trajectory and component, averages, changes."""
    rows = []
    for name, breakdown in report.laws.items():
        total = breakdown.total
        key = [name, "3σ", significant(report.bands[name])]
        rows += [
            [*key, *map(_figure, total.three_sigma), *_against_reference(report, name, "3sigma")],
            ["", "mean error", "", *common(GRAM_METRE * total.mean_error), "", "", "", ""],
            ["", "3 rms", "", *map(_figure, total.three_rms), *_against_reference(report, name, "rms")],
        ]
    base, cells = report.averages("reference"), []
    for goal, least in report.bound.items():
        if least is not None:
            cells += [_figure(least), _change(least, base[goal]) if report.noise_share(goal) >= RULES else ""]
    if cells:
        rows.append(["bound", "3σ", "", *("" for _ in COMPONENTS), *cells])
    head = ["g·m²", "", "band, Hz", *COMPONENTS, "moments", "change, %", "products", "change, %"]
    return Table("Predicted 3σ and mean error of each trajectory, g·m²", head, rows, BUDGET_NOTE)


def _sources(report: DesignReport) -> Table:
    """The average 3σ of each source alone, by trajectory."""
    head = ["alone, g·m²", *(f"{name}, {goal}" for name in report.laws for goal in BOTH)]
    rows = []
    for source in report.laws[NAME].sources:
        alone = [breakdown.sources[source].three_sigma for breakdown in report.laws.values()]
        cells = [_figure(average(three_sigma, goal)) for three_sigma in alone for goal in BOTH]
        rows.append([source.replace("_", " "), *cells])
    return Table("Each source alone: average 3σ, g·m²", head, rows)


def _against_reference(report: DesignReport, name: str, objective: str) -> list[str]:
    """Averages of moments and products, each with its change against the reference's."""
    averages, base = report.averages(name, objective), report.averages("reference", objective)
    return [cell for goal in BOTH for cell in (_figure(averages[goal]), _change(averages[goal], base[goal]))]


def _averages_in_words(report: DesignReport, objective: str) -> str:
    averages, base = report.averages(NAME, objective), report.averages("reference", objective)
    return " and ".join(
        f"of the {goal} {_figure(averages[goal])} g·m² ({_change(averages[goal], base[goal])} %)" for goal in BOTH
    )


def _bound_in_words(report: DesignReport) -> list[str]:
    """Sentences on the least 3σ of any motion, or on the source that rules where the bound says little."""
    bounds = {goal: f"{_figure(least)} g·m²" for goal, least in report.bound.items() if least is not None}
    ruled = [f"{figure} ({goal})" for goal, figure in bounds.items() if report.noise_share(goal) >= RULES]
    sentences = [f"No motion under these limits can have a 3σ below {' and '.join(ruled)}."] if ruled else []
    for goal, figure in bounds.items():
        if report.noise_share(goal) < RULES:
            shares = report.source_shares(goal)
            name = max(shares, key=lambda source: shares[source])
            rules = f"{name.replace('_', ' ')} makes {100 * shares[name]:.0f} % of the variance"
            counts = f"The bound of the {goal}, {figure}, counts the load cell's noise alone"
            sentences.append(f"{counts}, but {rules}: it is not informative.")
    return sentences


def _figure(value: float) -> str:
    return significant(GRAM_METRE * value)


def _change(value: float, base: float) -> str:
    return fixed(100 * (value / base - 1), 1)


def _shown(design: Design) -> tuple[Any, Any]:
    """Motion and effort of the design at the instants that figures show."""
    spec, experiment = design.spec, design.experiment
    shown = min(SHOWN, spec.duration)
    last = np.ceil((spec.duration + shown) / 2 * RATE) / RATE
    t = jnp.arange(0.0, last, 1 / RATE)
    run = motion_at(experiment, spec, t)
    motion = jax.tree.map(lambda x: x[len(t) - round(shown * RATE) :], run)
    return motion, effort_of(experiment, motion)


def _scene(design: Design, motion: Any) -> Scene:
    """The scene that the drawing of the platform shows."""
    experiment = design.experiment
    step = round(RATE / FRAMES)
    shown = slice(0, round(PLAYED * RATE) + 1, step)
    position, rotation = (np.asarray(x)[shown] for x in motion.pose)
    seconds = (len(position) - 1) / FRAMES
    return scene(experiment.platform, experiment.body, experiment.r_cg_from_omb, position, rotation, seconds)


VIEW = "grey box: a cuboid of the body's mass and tensor; red dot: its centre of gravity."
COVERAGE = (
    "Directions in the body frame that the same seconds visit: within 15° of {} of all axes the angular velocity comes "
    "with half its largest magnitude or more, the angular acceleration within 15° of {}."
)
LEGS = "The legs over the same seconds, each against its own limit; dashed: the limit."
COMPONENTS_OF = "3σ and mean error of each component with each trajectory, all sources together."
BUDGETS = "Average 3σ of moments and of products, all sources and the largest alone; dashed: no motion can beat it."
FILES = "Each file was read back and compared with the motion; JSON says columns, units, rotation order, signs."
NAMES = {
    "designed": "designed",
    "random": "best random series",
    "single": "one joint at a time",
    "with_undeclared": "designed, with undeclared errors",
}
"""Names of an arm's motions in the table."""
PLATFORM_METHOD = (
    "3σ is three standard deviations, the mean error the expected estimate less the truth, both by the law of "
    "propagation with every declared source; each trajectory's "
    "differentiator is matched to its own band. The reference is the named trajectory at the size and speed that "
    "promise most under the same limits. Confirm it: inertia montecarlo designed.toml --trajectory designed."
)
ARM_METHOD = (
    "3σ is three standard deviations of the best linear estimate of all ten parameters from force and moment under "
    "their declared white noise, the load cell's offsets estimated along. Both other motions are common practice "
    "in the same time, as large as the same limits allow."
)
WIDTHS = {"rms": "3√(σ² + mean error²)", "3sigma": "3σ"}
BUDGET_NOTE = (
    "3 rms: 3√(σ² + mean error²), three times the root mean square error. change: of the average, against the "
    "reference's. A longer run makes 3σ smaller, but not the mean error."
)
MOTION_NOTE = (
    "r_CG: the largest of its three. Random: the best of several Fourier series of five harmonics. "
    "Undeclared errors: of the load cell at typical size, which no duration averages."
)
LIMIT_NOTE = "Over the whole run with its ramps, on a grid ten times finer than the search's."
PLATFORM_LIMIT_NOTE = f"{LIMIT_NOTE.removesuffix('.')}; from 98 % on it limits."
PLATFORM_ASSUMPTIONS = (
    "The body is rigid; the platform runs the trajectory as commanded, and its legs turn in perfect joints.",
    "Leg forces are those of body, plate and legs by d'Alembert's principle, without friction.",
    "Every error source is as declared; the law of propagation takes its first and second order.",
)
ARM_ASSUMPTIONS = (
    "The body is rigid; joints are perfect; drives have neither friction nor inertia of their own.",
    "In the simulation computed torque with 0.8 of the payload, and feedback of 12 Hz, drives the joints.",
    "The tool's motion is known without error.",
)

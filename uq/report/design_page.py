"""The pages of a design, of its files and poses, and of what a platform really did."""

import numpy as np

from uq.excitation.design_report import GOALS, DesignReport
from uq.excitation.designed_experiment import NAME
from uq.figures import design_figures as design_plots
from uq.figures import sphere_axes as sphere
from uq.figures import sphere_figures as sphere_plot
from uq.figures.platform_figures import moving, still
from uq.planning.achieved_motion import SLOWEST, Achieved
from uq.planning.motion_export import MEANING, MotionExport
from uq.planning.pose_plan import PosePlan
from uq.report.page_parts import Drawing, Page, Table, source_tables


def design_page(report: DesignReport) -> Page:
    """Return the content of a design's report."""
    design = report.design
    relaxed = [] if design.bound is None else [f"The bound leaves out: {text}." for text in design.bound.relaxes]
    return Page(
        "The best experiment that a platform can run",
        [*report.verdicts(), COMPUTED],
        [
            *(
                []
                if design.improved
                else ["No design beat the reference within these limits: the reference is returned."]
            ),
            *(f"A limit is exceeded: {peak}." for peak in design.peaks if peak.share > 1 + 1e-6),
        ],
        [
            Table("Predicted 3σ of each trajectory, g·m²", *report.rows(), note=BUDGET_NOTE),
            Table("What each limit is used to", *report.limit_rows(), note=LIMIT_NOTE),
            Table("Which sensor should I buy?", *report.sensors.rows(), note=SENSOR_NOTE),
            Table("How long must I measure?", *report.duration_rows(), note=DURATION_NOTE),
        ],
        list(_figures(report)),
        [
            Table("Each source alone: average 3σ, g·m²", *report.source_rows()),
            Table("Searches", *_start_rows(report)),
            *source_tables(report.provenance),
        ],
        [*ASSUMPTIONS, *relaxed],
        report.provenance,
    )


def _figures(report: DesignReport) -> list[Drawing]:
    motion, found = report.stretch()
    t = np.asarray(motion.t)
    omega, alpha = np.asarray(motion.twist.omega), np.asarray(motion.twist.alpha)
    position = np.asarray(motion.pose.position) - np.asarray(report.design.experiment.platform.home)
    seen = report.scene(motion)
    covariance = report.laws[NAME].total.covariance
    targets = {goal: [one.target for one in report.durations if one.goal == goal] for goal in GOALS}
    visited = [f"{100 * sphere.visited(path):.0f} %" for path in (omega, alpha)]
    view = f"{seen.seconds:g} s of the motion, as fast and as large; {VIEW}"
    return [
        Drawing("platform", still(seen), view, moving(seen)),
        Drawing("motion", design_plots.motion(t, omega, alpha, position), f"{t[-1] - t[0]:.0f} s from the middle."),
        Drawing("legs", design_plots.legs(t, found, report.design.limits), LEGS),
        Drawing(
            "coverage", sphere_plot.covered(omega, alpha, covariance),
            COVERAGE.format(*visited),
        ),
        Drawing("budgets", design_plots.budgets(report.laws, report.bound), BUDGETS),
        Drawing("durations", design_plots.durations(report.durations[0].growth, targets), DURATIONS),
    ]  # fmt: skip


def _start_rows(report: DesignReport) -> tuple[list[str], list[list[str]]]:
    rows = [
        [f"{k}", f"{start.goal:.4f}", "yes" if start.met else "no"]
        for k, start in enumerate(report.design.starts, start=1)
    ]
    return ["start", "goal, reference = 1", "limits met"], rows


def motion_page(result: MotionExport) -> Page:
    """Return the content that exported files add to a report."""
    part = "" if result.speed == result.amplitude == 1 else (
        f"; rehearsal at {100 * result.speed:g} % of the speed, {100 * result.amplitude:g} % of the amplitude"
    )  # fmt: skip
    title = f"Exported motion, {result.seconds:.4g} s{part}"
    said = [f"{text[0].upper()}{text[1:]}." for text in (MEANING["frames"], MEANING["rotation"])]
    return Page(title, [], [], [], [], [Table(title, *result.rows(), note=FILES)], said, result.provenance)


def poses_page(result: PosePlan) -> Page:
    """Return the content that a list of static poses adds to a report."""
    return Page(
        "Static poses", [], [],
        [Table("Static poses for mass and centre of gravity: what they promise", *result.promise_rows(), note=POSES)],
        [],
        [Table(f"Static poses to run, {result.hold:g} s each", *result.rows())],
        ["Force and moment of a static pose are averaged; its noise is white and its constant offsets are estimated."],
        result.provenance,
    )  # fmt: skip


def achieved_page(result: Achieved) -> Page:
    """Return the content of the report of a run beside its plan."""
    still_rows = result.stillness_rows()
    by = "" if result.stillness is None else f"By the {result.stillness.by}, from {SLOWEST:g} Hz to the motion's band."
    return Page(
        f"What was run: {result.run} beside {result.trajectory}",
        [f"{result.summary()[0].upper()}{result.summary()[1:]}.", FOLLOWED],
        result.warnings,
        [
            Table("How each axis followed", *result.rows(), note=LAG),
            Table("Predicted 3σ, g·m²", *result.width_rows(), note=PREDICTED),
            *([Table("How still the centre of gravity was", *still_rows, note=by)] if still_rows[1] else []),
        ],
        [Drawing("followed", design_plots.followed(*result.trace), "Some seconds from the middle of the motion.")],
        source_tables(result.provenance),
        ["The displacement of the platform's centre was that of the plan; the attitude follows the gyro."],
        result.provenance,
    )


COMPUTED = (
    "3σ is three standard deviations by the law of propagation with every declared source; each trajectory's "
    "differentiator is matched to its own band. The reference is the named trajectory at the size and speed that "
    "promise most under the same limits. Confirm it: inertia montecarlo designed.toml --trajectory designed."
)
BUDGET_NOTE = "change: of the average, against the reference's."
LIMIT_NOTE = "Over the whole run with its ramps, on a grid ten times finer than the search's; from 98 % on it limits."
SENSOR_NOTE = "By component: derivative of ln 3σ by ln sigma. 0.8 says that 1 % less of this sigma leaves 0.8 % less."
DURATION_NOTE = (
    "Noise is averaged over time; what is drawn once, such as the centre of gravity's error, is not. Ramps and motion "
    "stay as they are; each duration is checked by the law at that duration."
)
VIEW = "grey box: a cuboid of the body's mass and tensor; red dot: its centre of gravity."
COVERAGE = (
    "Directions in the body frame that the same seconds visit: within 15° of {} of all axes the angular velocity comes "
    "with half its largest magnitude or more, the angular acceleration within 15° of {}."
)
LEGS = "The legs over the same seconds, each against its own limit; dashed: the limit."
BUDGETS = (
    "Average 3σ of moments and of products, all sources and each alone; dashed: what no motion can beat, if known."
)
DURATIONS = "Average 3σ over the duration; grey: the duration as designed; dotted: the targets."
FILES = "Each file was read back and compared with the motion; JSON says columns, units, rotation order, signs."
POSES = (
    "naive: as many poses level and along ±x, ±y. The list, poses.csv, is read by inertia centre once the mean force "
    "and moment of each pose are filled in."
)
FOLLOWED = "The run's angular velocity is fitted by the planned one: amplitude, lag, and offset of each axis."
LAG = "lag: counted from the run's first sample; ± is a standard error, from the residuals."
PREDICTED = "By the law of propagation, the measured angular velocity in place of the planned one."
ASSUMPTIONS = (
    "The body is rigid; the platform runs the trajectory as commanded, and its legs turn in perfect joints.",
    "Leg forces are those of body, plate and legs by d'Alembert's principle, without friction.",
    "Every error source is as declared; the law of propagation takes its first and second order.",
)

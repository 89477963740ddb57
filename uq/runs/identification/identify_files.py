"""Identification of a body's tensor from its recorded runs: the function behind ``inertia identify``."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from identify.choices import OffsetChoice
from identify.estimation.joint.priors import Alignment
from identify.estimation.methods.base import RunMap
from identify.estimation.methods.source import ALIGNED, NO_OFFSETS
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import explains_names
from identify.identification import identify
from identify.judge.run_findings.repeatability import RunsScatter
from identify.least_squares.offsets import rest_of
from identify.least_squares.run_lines import check_rate
from identify.results.covariances import check_covariances
from identify.results.declaration import ResidualCause
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run, RunError
from identify.signals.segments import Segment, still
from rig.exceptions import quoted
from uq.experiment.calibration_table import calibration_warnings, check_instruments
from uq.experiment.experiment import Experiment
from uq.experiment.report_table import cautions
from uq.experiment.undeclared_table import NONE
from uq.files.provenance import provenance
from uq.processes.process_pool import run_map
from uq.progress_bar import Progress, progress_of
from uq.runs.identification.centre_errors import check_declared
from uq.runs.identification.centre_prior import centre_provenance, load_centre, with_centre_prior, with_free_centre
from uq.runs.identification.estimated_errors import drawn_unknowns, estimated_errors
from uq.runs.identification.run_scatter import ScatterVerdict, discordance, pooled_scatter_verdict
from uq.runs.identification.systematic_errors import with_declared_sources
from uq.runs.identification.undeclared import with_undeclared
from uq.runs.inspection.experiment_findings import convention_warnings
from uq.runs.recorded.gravity_compensation import undo
from uq.runs.recorded.load_run import load
from uq.runs.recorded.measured_noise import noise_warnings
from uq.runs.recorded.time_window import TimeWindow, cut, names_marks
from uq.sources.constant_errors import declared_mean, declared_sigma
from uq.sources.source import KINDS, is_declared

WITH_FIXTURE = "the result is of body and fixture: tare_files(result, [], experiment) takes off what [fixture] states"
COMPLETE = 'no error acts but the declared ones (undeclared = "none")'
NO_BOUND = "nothing holds undeclared errors of mass and centre of gravity: run `inertia centre` again"
FREE_CENTRE = "no centre of gravity is declared: it is estimated from the motion (prior: Q ± 0.3 m)"
OLD_NAME = "[not_included] is read as [undeclared], its new name"
CONSEQUENCE = " (possibly a consequence of the suspicions above: resolve those first)"

LONGEST = 180
"""Most characters of an error together with what is suspicious of the runs."""


@explains_names
def identify_files(
    paths: str | Path | Sequence[str | Path],
    experiment: Experiment,
    *,
    estimator: str | None = None,
    offsets: OffsetChoice | None = None,
    windows: Sequence[TimeWindow] | None = None,
    mountings: Sequence[str] | None = None,
    centre: str | Path | Centre | None = None,
    method: str | None = None,
    validate: bool = False,
    processes: int | None = None,
    progress: Progress | bool | None = None,
) -> Identification:
    """Identify the tensor from recorded runs of one body; with its fixture, which ``tare_files`` takes off.

    Args:
        paths: files or rosbag2 folders, one per run; or a single one.
        experiment: r_CG with its uncertainty, estimators, what the channels mean.
        estimator: name of the estimator; None for the recording's, or the first.
        offsets: where constant offsets come from; None: as the experiment says.
        windows: the time windows of each run that count; None: where it moves.
        mountings: name of the mounting that each run was made with; None: as the runs' metadata say.
        centre: the result of static poses, or its centre.json, whose mass and centre of gravity count; None: the
            experiment's.
        method: the estimator of :func:`identify.identify`; None: the recording's.
        validate: whether each run, or each half of a single one, is also predicted by the others (``validation``).
        processes: most processes among which many runs are shared, which changes no number; None: as many as there are
            processors.
        progress: called with "runs", those done and all of them, in each of some passes over many; True: a bar.

    Raises:
        ExperimentError, RigError, RunError: see :func:`uq.runs.recorded.load_run.load_run`,
            :func:`uq.runs.recorded.time_window.resolve`, :func:`uq.runs.recorded.gravity_compensation.undo`,
            :func:`labelled`, :func:`identify.identify` and
            :func:`uq.runs.identification.systematic_errors.with_declared_sources`.
    """
    paths = [paths] if isinstance(paths, (str, Path)) else list(paths)
    with run_map(len(paths), processes, progress_of(progress, "runs")) as map_runs:
        return _identified(
            paths, experiment, map_runs, estimator=estimator, offsets=offsets, windows=windows, mountings=mountings,
            centre=centre, method=method, validate=validate,
        )  # fmt: skip


def _identified(
    paths: Sequence[str | Path], experiment: Experiment, map_runs: RunMap, *, estimator: str | None,
    offsets: OffsetChoice | None, windows: Sequence[TimeWindow] | None, mountings: Sequence[str] | None,
    centre: str | Path | Centre | None, method: str | None, validate: bool,
) -> Identification:  # fmt: skip
    """Identify the tensor, with what is done run by run done by ``map_runs``; see :func:`identify_files`."""
    if len({Path(path).resolve() for path in paths}) < len(paths):
        raise RunError("a run is given twice: name each file once")
    check_count(mountings, len(paths))
    if offsets is not None:
        experiment = replace(experiment, recording=msgspec.structs.replace(experiment.recording, offsets=offsets))
    declared_inputs = experiment.inputs()
    mass_and_centre = _mass_and_centre(experiment, centre, method)
    experiment, prior = mass_and_centre.experiment, mass_and_centre.prior
    if experiment.recording.zero_frame == "base" and method not in (None, "joint"):
        raise RunError(f"recording.zero_frame is base, which the method {method} does not know: use the method joint")
    experiment.stated_r_cg  # noqa: B018 - says at once where there is none
    spec = experiment.estimator(estimator) if experiment.estimators or estimator else None
    prepare = partial(prepared_run, experiment=experiment, spec=spec, windows=windows, compact=len(paths) > 1)
    prepared = list(map_runs(prepare, paths))
    runs = labelled([run for run, _ in prepared], mountings)
    inputs = [{"file": str(path), "sha256": run.sha256, **run.about} for path, run in zip(paths, runs, strict=True)]
    check_instruments(experiment.calibrations, inputs)

    def estimated(runs: list[Run], validate: bool = False) -> Identification:
        return _estimated(runs, experiment, spec, prior, method, validate=validate, map_runs=map_runs)

    joint = (method or experiment.recording.method) == "joint"
    # asked for before the estimate, so that processes judge conventions while this one judges all runs together
    suspicions = chain.from_iterable(
        map_runs(partial(convention_warnings, experiment=experiment, turn_free=joint, zero=prior), runs)
    )
    try:
        result = estimated(runs, validate)
        apart = discordance(result, runs, estimated)
        result = with_undeclared(result, runs, experiment, prior)
        if apart is not None:
            result = result.joined(discordance=apart, warnings=(*result.warnings, *apart.warnings))
    except RunError as error:
        more = "; ".join(suspicions)
        if len(f"{error}{more}") > LONGEST:
            more = "see also `inertia inspect`"
        raise RunError("; ".join(filter(None, [str(error), more]))) from None
    repeats = pooled_scatter_verdict(result.pooling) if result.pooling else None
    aligned = result.rotation is not None and result.rotation.estimated
    suspicious = list(suspicions)
    # axes, signs and units that contradict mechanics are behind most else; of joint what left its prior comes first
    first, then = (result.warnings, suspicious) if aligned else (suspicious, _after(suspicious, result))
    noisy = [text for run in runs for text in noise_warnings(run, experiment.sources)]
    assumed = dict.fromkeys([*mass_and_centre.assumptions, *(text for _, texts in prepared for text in texts)])
    on_body = (*([] if experiment.fixture is None else [WITH_FIXTURE]), *mass_and_centre.warnings)
    of_rig = calibration_warnings(experiment.calibrations, inputs, date.today())
    return result.joined(
        warnings=(*on_body, *of_rig, *first, *then, *noisy, *cautions(experiment.report, inputs)),
        consistency=(*result.consistency, *([_repeatability(repeats)] if repeats and (repeats.sign > 0).any() else [])),
        assumptions=(*assumed, *_uncontradicted(result.assumptions, experiment), *_on_undeclared(experiment, prior)),
        provenance=provenance(**declared_inputs, **mass_and_centre.provenance, inputs=inputs),
        datum=experiment.datum,
    )


class _MassAndCentre(NamedTuple):
    """The experiment with the mass and centre of gravity that count, and what is said of them."""

    experiment: Experiment
    prior: Centre | None = None
    """The static poses that tell them; None: none do."""
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = {}


def _mass_and_centre(experiment: Experiment, centre: str | Path | Centre | None, method: str | None) -> _MassAndCentre:
    """Mass and centre of gravity by static poses; else as declared, or by a scale, or for the motion to tell."""
    if centre is not None:
        prior = load_centre(centre)
        check_declared(experiment, prior, "centre" if isinstance(centre, Centre) else Path(centre).name)
        experiment, warnings = with_centre_prior(experiment, prior)
        return _MassAndCentre(experiment, prior, warnings, provenance={"centre": centre_provenance(centre, prior)})
    if experiment.scale is not None:
        experiment = replace(experiment, mass=experiment.scale[0])
    recording = experiment.recording
    needed = recording.zero == "loaded" or (recording.removes_weight and recording.payload_mass is None)
    if experiment.r_cg_from_q is None and (method or recording.method) == "joint" and not needed:
        return _MassAndCentre(with_free_centre(experiment), assumptions=(FREE_CENTRE,))
    return _MassAndCentre(experiment)


def _uncontradicted(assumptions: Sequence[str], experiment: Experiment) -> list[str]:
    """Return the estimator's assumptions, without those that declared sources contradict."""
    declared = [(source.target, source.kind) for source in experiment.sources]

    def acts(kind: str, *targets: str) -> bool:
        return any(is_declared(target, KINDS[target, kind], declared) for target in targets)

    turned, delayed = acts("misalignment", "wrench", "omega"), acts("delay", "omega")
    aligned = " and ".join(how for how, errs in (("in time", delayed), ("in frame", turned)) if not errs)
    instead = {f"{ALIGNED} in time and in frame": f"{ALIGNED} {aligned}" if aligned else ""}
    if acts("bias", "F", "M"):
        instead[NO_OFFSETS] = f"{NO_OFFSETS} beyond those declared"
    return [text for text in (instead.get(text, text) for text in assumptions) if text]


def _on_undeclared(experiment: Experiment, centre: Centre | None) -> list[str]:
    complete = [COMPLETE] if experiment.undeclared == NONE else []
    calibrated = [f"the rig is as it was in the {calibration.title}" for calibration in experiment.calibrations]
    old = [NO_BOUND] if centre is not None and centre.undeclared is None else []
    return [*complete, *calibrated, *old, *([OLD_NAME] if "not_included" in experiment.document else [])]


def _after(suspicious: list[str], result: Identification) -> list[str]:
    """The result's warnings; a cause that its residuals show may be but a consequence of what is suspicious."""
    shown = {verdict.text for verdict in result.consistency} if suspicious else set()
    return [f"{text}{CONSEQUENCE}" if text in shown else text for text in result.warnings]


def _estimated(
    runs: list[Run],
    experiment: Experiment,
    spec: EstimatorSpec | None,
    prior: Centre | None,
    method: str | None,
    *,
    validate: bool,
    map_runs: RunMap,
) -> Identification:
    """The tensor of some runs, with what is declared of them."""
    duration = float(np.mean([run.t[-1] - run.t[0] for run in runs]))
    redrawn = experiment.recording.drawn_by_mounting if len({run.mounting for run in runs}) > 1 else ()
    result = identify(
        runs,
        r_cg=experiment.stated_r_cg,
        sigma_r_cg=experiment.sigma_r_cg,
        estimator=spec,
        offsets=experiment.recording.offsets,
        mass=experiment.mass,
        centre=prior,
        method=method or experiment.recording.method,
        alignment=alignment_of(experiment),
        cg_motion=experiment.recording.cg_motion,
        gravity=experiment.gravity,
        mass_uncertainty=None if experiment.scale is None else experiment.scale[1],
        errors=estimated_errors(experiment, duration, redrawn),
        drawn_by_mounting=drawn_unknowns(experiment),
        validate=validate,
        map_runs=map_runs,
    )
    result = with_declared_sources(result, runs, experiment, redrawn=experiment.recording.drawn_by_mounting)
    check_covariances(result)
    return result


def alignment_of(experiment: Experiment) -> Alignment:
    """Return the prior of delay and rotation of the IMU: as the recording states, else as declared sources have it."""
    recording, stated = experiment.recording, experiment.recording.alignment
    delay, turn = (declared_sigma(experiment.sources, field) for field in ("gyro_delay", "gyro_misalignment"))
    if recording.sigma_delay is None and delay > 0:
        mean_delay = stated.delay + float(declared_mean(experiment.sources, "gyro_delay"))
        stated = replace(stated, sigma_delay=float(delay), delay=mean_delay)
    if recording.sigma_rotation is None and turn.any():
        mean = np.add(stated.rotation, declared_mean(experiment.sources, "gyro_misalignment"))
        stated = replace(stated, sigma_rotation=tuple(turn.tolist()), rotation=tuple(mean.tolist()))
    return stated


def _repeatability(repeats: ScatterVerdict) -> ResidualCause:
    worst = int(np.argmin(np.where(repeats.sign > 0, repeats.probability, np.inf)))
    scatter = RunsScatter(topic="", comparison=repeats.text)
    return scatter.verdict(axis=COMPONENTS[worst], share=float(repeats.ratio[worst]))


def prepared_run(
    path: str | Path, experiment: Experiment, spec: EstimatorSpec | None, windows: Sequence[TimeWindow] | None,
    *, compact: bool = False,
) -> tuple[Run, tuple[str, ...]]:  # fmt: skip
    """Return the segments of a run that count, its weight put back, with its rest; and what is assumed.

    Args:
        path: of the run.
        experiment: what the channels mean, and where the weight acts.
        spec: the estimator; None: it is found in the run.
        windows: the time windows that count; None: where it moves.
        compact: whether the samples beyond what counts are let go of.
    """
    run, assumed = _prepared(path, experiment, spec, windows)
    return run.compact if compact else run, assumed


def _prepared(
    path: str | Path, experiment: Experiment, spec: EstimatorSpec | None, windows: Sequence[TimeWindow] | None
) -> tuple[Run, tuple[str, ...]]:
    recording = experiment.recording
    band = None if spec is None else spec.band
    recorded = load(path, recording, gravity=experiment.gravity, band=band, marks=names_marks(windows))
    if not recorded.run.omega.any():
        raise RunError(
            f"the angular velocity in {recorded.run.name} is zero, or no number, in most samples: "
            "check the motion sensor and its driver, or record a body that moves"
        )
    chosen = cut(recorded.run, windows, recorded.marks)
    if spec is not None:
        check_rate(chosen, spec)
    weighed = () if recording.compensated else ("no driver removed the body's weight from the wrench",)
    assumed = (*recorded.assumptions, *weighed)
    if chosen.specific_force is not None and experiment.mass is not None and chosen.imu_position is None:
        assumed = (*assumed, "the accelerometer is at Q")
    if not recording.removes_weight and recording.offsets == "estimate":
        return chosen, assumed
    rests = _near(recorded.run, chosen)
    begin = min([float(chosen.t[0]), *(rest.start for rest in rests)])
    end = max([float(chosen.t[-1]), *(rest.stop for rest in rests)])
    run = recorded.run.between(begin, end)
    rests = tuple(Segment(rest.start - begin, rest.stop - begin) for rest in rests)
    run, more = undo(run, rests, experiment)
    if recording.offsets == "still":
        run = replace(run, rest=rest_of(run, rests))
    used = run.within(chosen.segments) if chosen.segments else run
    cut_out = {name: getattr(chosen, name) for name in ("segments", "detected", "left_out", "overview")}
    return replace(used, **cut_out), (*assumed, *more)


def _near(run: Run, chosen: Run) -> tuple[Segment, ...]:
    """The segments of rest within the span that counts, the last before and the first after it [s]."""
    shift = float(run.t[0])
    segments = still(run.rate, run.omega, run.force, run.moment)
    rests = [Segment(rest.start + shift, rest.stop + shift) for rest in segments]
    start, stop = float(chosen.t[0]), float(chosen.t[-1])
    before = [rest for rest in rests if rest.stop < start][-1:]
    after = [rest for rest in rests if rest.start > stop][:1]
    return (*before, *(rest for rest in rests if rest.stop >= start and rest.start <= stop), *after)


def mounting_names(text: str) -> tuple[str, ...]:
    """Return the names of ``--mounting``, separated by commas.

    Raises:
        RunError: one of them is empty.
    """
    mountings = tuple(word.strip() for word in text.split(","))
    if not all(mountings):
        raise RunError(f"--mounting is {quoted(text)}: give a name for each run, separated by commas, such as A,A,B")
    return mountings


def check_count(mountings: Sequence[str] | None, runs: int) -> None:
    """Refuse names of mountings that are not one per run.

    Raises:
        RunError: there are more or fewer.
    """
    if mountings is not None and len(mountings) != runs:
        raise RunError(f"--mounting names {len(mountings)} mountings for {runs} runs: give one name per run")


def labelled(runs: Sequence[Run], mountings: Sequence[str] | None) -> list[Run]:
    """Return the runs with the names of their mountings.

    Args:
        runs: the runs, which may name their own.
        mountings: one name per run; None: the runs' own.

    Raises:
        RunError: not one name per run, or some runs name their mounting and others do not.
    """
    if mountings is not None:
        check_count(mountings, len(runs))
        return [replace(run, mounting=name) for run, name in zip(runs, mountings, strict=True)]
    silent = [run.name for run in runs if run.mounting is None]
    if 0 < len(silent) < len(runs):
        raise RunError(f"{silent[0]} does not name its mounting, others do: name one for every run by --mounting")
    return list(runs)

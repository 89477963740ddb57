"""Calibration of a rig by recorded runs of known bodies: the function behind ``inertia calibrate``."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from identify.display.rounding import significant
from identify.errors.registry import ERRORS
from identify.estimation.joint.priors import Alignment
from identify.estimation.methods.base import Problem
from identify.estimation.methods.joint import specific_force_source
from identify.exceptions import RunError, explains_names
from identify.judge.judged_fits import judged_ways
from identify.known_bodies import Doubt, KnownBody, RigErrors, rig_errors
from identify.results.declaration import ResidualCause
from identify.results.identification_result import Identification
from uq.bodies.calibration.calibration_result import CalibratedError, Calibration, units_of
from uq.bodies.calibration.open_errors import OpenErrors, open_errors
from uq.bodies.reference import Reference, load_reference
from uq.experiment.experiment import Experiment
from uq.experiment.report_table import recorded_days, recorded_instruments
from uq.files.mistakes import ExperimentError
from uq.files.provenance import provenance
from uq.runs.identification.centre_prior import with_mass_and_centre
from uq.runs.identification.identify_files import alignment_of, identify_files, prepared_run
from uq.runs.identification.undeclared import largest_wrench
from uq.sources.draw_figures import part_of

IMPROBABLE = 0.01
"""Chance of a departure of the rig's errors from their priors below which it is told."""
DOUBTED = 3.0
"""Natural logarithm of the odds from which a parameter of the known body is named."""
SCATTER = {"repeatability"}
"""Findings on the scatter of runs, which widens the calibration."""
RIGHT = "mass, centre of gravity and tensor of the known bodies are as stated, with their uncertainties"


@explains_names
def calibrate_files(
    bodies: Sequence[tuple[str | Path | Reference, Sequence[str | Path]]],
    experiment: Experiment,
    *,
    due: date | None = None,
) -> Calibration:
    """Return the rig's errors by runs of known bodies.

    Args:
        bodies: each known body, or its file, with its runs.
        experiment: what the channels mean, the declared errors of the rig, typical figures of the others.
        due: day by which the rig is to be calibrated again; None: not stated.

    Raises:
        ExperimentError, RigError, RunError: as for :func:`uq.runs.identification.identify_files.identify_files`; the
            experiment takes a calibration already, or leaves nothing open.
    """
    if experiment.calibrations:
        raise ExperimentError("the experiment includes a calibration: take it out of include to make another")
    if not bodies or not all(paths for _, paths in bodies):
        raise RunError("a known body has no runs: name them behind it")
    prepared = [_Prepared(body, paths, experiment) for body, paths in bodies]
    first = prepared[0]
    runs = [run for body in prepared for run in body.runs]
    duration = float(np.mean([run.t[-1] - run.t[0] for run in runs]))
    opened = open_errors(
        experiment, duration, largest_wrench(runs), aligned=first.identified.method == "joint", absent=first.absent
    )
    if not opened.priors:
        raise ExperimentError("no error of the rig is open: declare them in [[source]], or write [undeclared]")
    posterior = rig_errors([body.with_errors(opened) for body in prepared])
    errors, covariance = _calibrated(opened, posterior, first.with_errors(opened).alignment)
    inputs = [entry for body in prepared for entry in body.inputs]
    warnings = [f"{body.name}: {finding.text}" for body in prepared for finding in _elsewhere(body.identified)]
    performed = recorded_days(inputs)
    about: dict[str, Any] = {"made": date.today()} | ({"performed": performed[-1]} if performed else {})
    about |= {"due": due} if due else {}
    about["run"] = [
        {"file": Path(entry["file"]).name, "sha256": entry["sha256"], "body": body.name}
        for body in prepared for entry in body.inputs
    ]  # fmt: skip
    if instruments := [instrument.texts for instrument in recorded_instruments(inputs)]:
        about["instrument"] = instruments
    return Calibration(
        errors=errors, covariance=covariance, departure=posterior.departure, directions=posterior.directions,
        chance=posterior.chance, scatter=posterior.scatter, doubts=posterior.doubts,
        group=_group(about), about=about, warnings=(*_departures(posterior, errors), *warnings),
        assumptions=(RIGHT, *first.identified.assumptions),
        provenance=provenance(**experiment.inputs(), bodies=[body.about for body in prepared], inputs=inputs),
    )  # fmt: skip


class _Prepared:
    """A known body with its runs, read, and what an ordinary identification finds in them."""

    def __init__(self, body: str | Path | Reference, paths: Sequence[str | Path], experiment: Experiment) -> None:
        self.reference = body if isinstance(body, Reference) else load_reference(body)
        self.name = self.reference.name
        if not np.isfinite(self.reference.parameters.inertia).all():
            raise ExperimentError(f"{self.name} states no tensor: a known body needs one")
        self.about = {"name": self.name, "file": self.reference.file, "sha256": self.reference.sha256}
        self.experiment = self._with_body(experiment)
        self.identified = identify_files(paths, self.experiment)
        spec = self.experiment.estimator() if self.experiment.estimators else None
        self.runs = [prepared_run(path, self.experiment, spec, None)[0] for path in paths]
        self.inputs: list[Mapping[str, Any]] = list(self.identified.provenance["inputs"])
        recording = self.experiment.recording
        self.problem = Problem(
            runs=tuple(self.runs), r_cg=self.experiment.stated_r_cg, sigma_r_cg=self.experiment.sigma_r_cg,
            estimator=spec, offsets=recording.offsets, mass=self.experiment.mass,
            alignment=alignment_of(self.experiment), cg_motion=recording.cg_motion, gravity=self.experiment.gravity,
        )  # fmt: skip

    def _with_body(self, experiment: Experiment) -> Experiment:
        """The experiment with what is known of this body's mass and centre of gravity."""
        ten, u = self.reference.parameters, self.reference.parameters.standard_uncertainty
        r_cg, sigma = np.asarray(ten.r_cg), u[1:4]
        if not np.isfinite(r_cg).all():
            r_cg, sigma = experiment.stated_r_cg, experiment.sigma_r_cg
        mass = float(ten.mass) if np.isfinite(ten.mass) else experiment.mass
        return replace(with_mass_and_centre(experiment, mass, r_cg, sigma, self.name), scale=None)

    @property
    def absent(self) -> frozenset[str]:
        """Conditions of errors that this rig does not meet."""
        absent = set()
        weightless = any(map(judged_ways(self.identified, self.problem).falls, self.runs))
        if weightless:
            absent.add("mounting")
        if weightless or specific_force_source(self.problem) != "accelerometer":
            absent.add("accelerometer")
        return frozenset(absent)

    def with_errors(self, opened: OpenErrors) -> KnownBody:
        """Return the body with the errors that are open."""
        problem = replace(self.problem, errors=opened.priors)
        return KnownBody(self.name, self.reference.parameters, problem, self.identified)


def _calibrated(
    opened: OpenErrors, posterior: RigErrors, alignment: Alignment
) -> tuple[tuple[CalibratedError, ...], np.ndarray]:
    """The errors by target and kind, and the covariance of all their numbers."""
    together: dict[tuple[str, str], list[tuple[Any, np.ndarray]]] = {}
    for source, axes, root in opened.parts(alignment):
        if axes not in posterior.axes:
            continue
        by_axis = np.zeros((len(root), len(posterior.mean)))
        by_axis[:, posterior.axes[axes]] = root
        together.setdefault((source.target, source.kind), []).append((source, by_axis))
    errors, rows = [], []
    for parts in together.values():
        first, by_axis = parts[0][0], np.sum([by for _, by in parts], axis=0)
        shape = np.shape(first.sigma)
        mean = np.sum([np.broadcast_to(source.mean, shape) for source, _ in parts], axis=0).ravel()
        errors.append(
            CalibratedError(
                source=replace(first, mean=mean.reshape(shape)), prior=np.linalg.norm(by_axis, axis=1),
                mean=mean + by_axis @ posterior.mean,
                standard_uncertainty=np.sqrt(np.maximum(np.diag(by_axis @ posterior.covariance @ by_axis.T), 0.0)),
                distance=posterior.distance(by_axis),
            )
        )  # fmt: skip
        rows.append(by_axis)
    every = np.concatenate(rows)
    return tuple(errors), every @ posterior.covariance @ every.T


def _elsewhere(identified: Identification) -> list[ResidualCause]:
    """Findings that are no errors of load cell or IMU, which the calibration itself finds."""
    sensors = {error.label for error in ERRORS.values() if error.part not in ("body", "rig") and error.scope == "rig"}
    return [
        finding for finding in identified.consistency if finding.cause not in {*sensors, *SCATTER} and not finding.note
    ]


def _group(about: Mapping[str, Any]) -> str:
    """A name for the group of the sources that no other calibration has."""
    hashes = "".join(sorted(run["sha256"] for run in about["run"]))
    number = int(hashes[:12] or "0", 16) % 10**8 if hashes else 0
    return f"calibration_{about['made']:%Y%m%d}_{number:08d}"


def _departures(posterior: RigErrors, errors: Sequence[CalibratedError]) -> list[str]:
    """Text on errors that are larger than chance makes them, and on the known body's part in it."""
    doubts = [_doubt(doubt) for doubt in posterior.doubts[:2] if doubt.log_odds > DOUBTED]
    either = ", or ".join(doubts)
    if posterior.chance > IMPROBABLE:
        cure = "check the body, or add a second one"
        return [f"{either}, which is more probable than errors of the rig: {cure}"] if doubts else []
    text = (
        f"the rig's errors are larger than expected (chi-squared {posterior.departure:.0f} of {posterior.directions}): "
        f"{_largest(errors)}"
    )
    cure = "if the rig is known to err so, declare it wider in [[source]]; else check the body, or add a second one"
    return [f"{text}{'; or ' if doubts else ''}{either}: {cure}"]


def _largest(errors: Sequence[CalibratedError]) -> str:
    """The number that is farthest from its prior, in words."""
    worst = int(np.argmax([error.distance.max() for error in errors]))
    number = int(np.argmax(errors[worst].distance))
    error = errors[worst]
    unit = str(np.ravel(units_of(error.source))[number])
    mean, u = error.mean[number] / part_of(unit), error.standard_uncertainty[number] / part_of(unit)
    return (
        f"{error.source.kind.replace('_', ' ')} of {error.source.target}, number {number + 1}, is "
        f"{significant(mean, 2)} ± {significant(u, 2)} {unit}"
    )


def _doubt(doubt: Doubt) -> str:
    """A parameter of the known body that may be wrong, in words."""
    name, unit, per_si = (doubt.parameter, "g·m²", 1e3) if doubt.parameter != "mass" else ("mass", "g", 1e3)
    return (
        f"the {name} of {doubt.body} is {significant(per_si * doubt.change, 2, signed=True)} ± "
        f"{significant(per_si * doubt.uncertainty, 2)} {unit} off"
    )

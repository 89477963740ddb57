"""``inertia identify --tare``: the fixture, measured empty or stated, taken off an identified body."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.choices import OffsetChoice
from identify.display.rounding import exact
from identify.exceptions import RunError
from identify.least_squares.covariance_matrices import root_of
from identify.results.covariances import check_covariances
from identify.results.identification_result import Identification
from identify.results.ledger import FIXTURE, Ledger, Row, mass_row, taken_off
from identify.results.mass_and_centre import LEFT
from identify.rigid_body.fixture import Tare, check, left_over
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rigid_body.principal_axes import value_and_jacobian
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.identification.centre_prior import with_mass_and_centre
from uq.runs.identification.identify_files import WITH_FIXTURE, identify_files

STATE_FIXTURE = "give --tare-centre, or state them in [fixture], or record accelerations and use the method joint"
SHARED = "the tare's runs and poses share errors of the rig, and those of static poses that last, with the body's"


def tare_files(
    result: Identification,
    paths: Sequence[str | Path],
    experiment: Experiment,
    *,
    estimator: str | None = None,
    offsets: OffsetChoice | None = None,
    tare_centre: str | Path | None = None,
    method: str | None = None,
) -> Identification:
    """Return a result without the fixture: identified from runs of the empty platform, or stated in ``[fixture]``.

    Args:
        result: of the body with its fixture.
        paths: runs of the fixture alone; none: its tensor is the stated one.
        experiment: what the channels mean, estimators, and ``[fixture]``.
        estimator: name of the estimator, as for the result.
        offsets: where constant offsets come from, as for the result.
        tare_centre: the centre.json of the fixture alone; None: mass and centre of gravity are those of ``[fixture]``.
        method: the estimator of :func:`identify.identify`, as for the result; None: the recording's.

    Raises:
        ExperimentError: nothing tells the fixture's mass and centre of gravity, or two things tell its tensor.
        RigError, RunError: see :func:`uq.runs.identification.identify_files.identify_files` and
            :func:`identify.rigid_body.fixture.check`.
    """
    check_tare(paths, experiment, tare_centre, method)
    if not paths:
        return result if experiment.fixture is None else tared(result, experiment.fixture)
    loaded = {run.sha256 for run in result.runs}
    alone = fixture_alone(experiment, tare_centre, method)
    empty = identify_files(paths, alone, estimator=estimator, offsets=offsets, centre=tare_centre, method=method)
    if both := [run.file for run in empty.runs if run.sha256 in loaded]:
        raise RunError(f"{both[0]} is both loaded and empty: name the runs of the empty platform after --tare")
    if tare_centre is None and experiment.fixture is not None:
        empty = empty.joined([mass_row(float(experiment.fixture.standard_uncertainty[0]))])
    elif empty.mass is None:
        raise RunError(f"the runs of the empty platform do not determine the fixture's mass: {STATE_FIXTURE}")
    return tared(result, empty)


def check_tare(
    paths: Sequence[str | Path], experiment: Experiment, tare_centre: str | Path | None, method: str | None = None
) -> None:
    """Refuse what :func:`tare_files` cannot do, before anything is identified.

    Raises:
        ExperimentError, RunError: see there.
    """
    if paths:
        fixture_alone(experiment, tare_centre, method)
        return
    if tare_centre is not None:
        raise RunError("--tare-centre without --tare: name the runs of the empty platform, or state [fixture]")
    if experiment.fixture is not None and not np.isfinite(experiment.fixture.inertia).all():
        raise ExperimentError("no fixture.inertia: state it, or name runs of the empty platform with --tare")


def fixture_alone(experiment: Experiment, tare_centre: str | Path | None, method: str | None = None) -> Experiment:
    """Return the experiment with the fixture in the body's place.

    Where nothing states its mass and centre of gravity, the method ``joint`` identifies them with the tensor.

    Raises:
        ExperimentError: nothing tells the fixture's mass and centre of gravity, or two things tell its tensor.
    """
    fixture = experiment.fixture
    if fixture is not None and (tare_centre is not None or np.isfinite(fixture.inertia).all()):
        twice = "mass and centre of gravity" if tare_centre is not None else "inertia"
        raise ExperimentError(
            f"the fixture's {twice} is stated in [fixture] and measured by the tare: keep one of them"
        )
    empty = replace(experiment, r_cg_from_q=None, mass=None, scale=None, inertia=None, datum=None, fixture=None)
    if tare_centre is not None:
        return empty
    if fixture is None and (method or experiment.recording.method) == "joint":
        return empty
    if fixture is None:
        raise ExperimentError(f"--tare needs the fixture's mass and centre of gravity: {STATE_FIXTURE}")
    return with_mass_and_centre(empty, fixture.mass, fixture.r_cg, fixture.standard_uncertainty[1:4], "[fixture]")


def tared(
    result: Identification,
    empty: Identification | InertialParameters,
) -> Identification:
    """Return a result of the body alone: mass, centre of gravity and tensor without the fixture's.

    An error of the rig or of static poses that both results have under one key is one error: its changes add with their
    signs, and largely cancel. All others are independent.

    Args:
        result: of the body with its fixture.
        empty: of the fixture with the load cell's own moving plate.

    Raises:
        RunError: a mass is not known, the fixture is not lighter than the whole, or a covariance is none.
    """
    identified = empty if isinstance(empty, Identification) else None
    assembly, fixture = result.parameters, empty if isinstance(empty, InertialParameters) else empty.parameters
    check(assembly, fixture)
    body, jacobian = value_and_jacobian(left_over, np.concatenate([assembly.values, fixture.values]))
    stated = Ledger((Row(error=FIXTURE, changes=root_of(fixture.covariance)),))
    ledger = stated if identified is None else identified.ledger
    looked_at = identified is None or identified.looked_at_undeclared
    tare_warnings = () if identified is None else identified.warnings
    tare_declarations = [
        record._replace(words=f"tare: {record.words}") for record in (identified.declarations if identified else ())
    ]
    runs = () if identified is None else tuple((run.file, run.sha256) for run in identified.runs)
    fixture_text = f"the {'stated ' * (identified is None)}fixture ({exact([fixture.mass])[0]} kg) is taken off"
    body_warnings = [text for text in result.warnings if text != WITH_FIXTURE]
    left = replace(
        result,
        value=body,
        ledger=taken_off(result.ledger, ledger, jacobian[:, :10], jacobian[:, 10:]),
        centre_from=LEFT,
        looked_at_undeclared=result.looked_at_undeclared and looked_at,
        declarations=(*result.declarations, *tare_declarations),
        warnings=(*body_warnings, *(f"tare: {text}" for text in tare_warnings)),
        assumptions=(*result.assumptions, fixture_text, *(SHARED,) * bool(runs)),
        tare=Tare(fixture, assembly, runs, None if identified is None else dict(identified.provenance)),
    )
    check_covariances(left)
    return left

"""``inertia identify --tare``: the fixture, measured empty or stated, taken off an identified body."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.exceptions import RunError
from identify.results.identification_result import Identification
from identify.rigid_body.fixture import Tare, left_over, subtract
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.static.centre_result import Centre
from uq.experiment.experiment import Experiment
from uq.files.document import ExperimentError
from uq.identification.centre_prior import load_centre, with_mass_and_centre
from uq.identification.identify_files import identify_files

NORMAL = 1.959963984540054
"""Coverage factor of 95 % of a normal distribution."""
SEPARATE = "the tare's runs and poses share no errors with the body's but the lasting error of the attitudes"


def tare_files(
    result: Identification,
    paths: Sequence[str | Path],
    experiment: Experiment,
    *,
    estimator: str | None = None,
    offsets: OffsetChoice | None = None,
    centre: str | Path | None = None,
    tare_centre: str | Path | None = None,
) -> Identification:
    """Return a result without the fixture: identified from runs of the empty platform, or stated in ``[fixture]``.

    Args:
        result: of the body with its fixture.
        paths: runs of the fixture alone; none: its tensor is the stated one.
        experiment: what the channels mean, estimators, and ``[fixture]``.
        estimator: name of the estimator, as for the result.
        offsets: where constant offsets come from, as for the result.
        centre: the centre.json of the result.
        tare_centre: the centre.json of the fixture alone; None: mass and centre of gravity are those of ``[fixture]``.

    Raises:
        ExperimentError: nothing tells the fixture's mass and centre of gravity, or two things tell its tensor.
        RigError, RunError: see :func:`uq.identification.identify_files.identify_files` and
            :func:`identify.rigid_body.fixture.subtract`.
    """
    check_tare(paths, experiment, tare_centre)
    if not paths:
        return result if experiment.fixture is None else tared(result, experiment.fixture)
    loaded = {run.sha256 for run in result.runs}
    alone = fixture_alone(experiment, tare_centre)
    empty = identify_files(paths, alone, estimator=estimator, offsets=offsets, centre=tare_centre)
    if both := [run.file for run in empty.runs if run.sha256 in loaded]:
        raise RunError(f"{both[0]} is both loaded and empty: name the runs of the empty platform after --tare")
    if tare_centre is None:
        fixture = experiment.fixture
        assert fixture is not None  # noqa: S101 - fixture_alone has seen it
        empty = replace(empty, mass_uncertainty=float(fixture.standard_uncertainty[0]))
    if centre is None or tare_centre is None:
        return tared(result, empty)
    return tared(result, empty, cross=lasting_errors(result, empty, load_centre(centre), load_centre(tare_centre)))


def check_tare(paths: Sequence[str | Path], experiment: Experiment, tare_centre: str | Path | None) -> None:
    """Refuse what :func:`tare_files` cannot do, before anything is identified.

    Raises:
        ExperimentError, RunError: see there.
    """
    if paths:
        fixture_alone(experiment, tare_centre)
        return
    if tare_centre is not None:
        raise RunError("--tare-centre without --tare: name the runs of the empty platform, or state [fixture]")
    if experiment.fixture is not None and not np.isfinite(experiment.fixture.inertia).all():
        raise ExperimentError("no fixture.inertia: state it, or name runs of the empty platform with --tare")


def fixture_alone(experiment: Experiment, tare_centre: str | Path | None) -> Experiment:
    """Return the experiment with the fixture in the body's place.

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
    if fixture is None:
        raise ExperimentError(
            "--tare needs the fixture's mass and centre of gravity: give --tare-centre, or state them in [fixture]"
        )
    return with_mass_and_centre(empty, fixture.mass, fixture.r_cg, fixture.standard_uncertainty[1:4], "[fixture]")


def tared(
    result: Identification,
    empty: Identification | InertialParameters,
    *,
    cross: Float[np.ndarray, "10 10"] | None = None,
) -> Identification:
    """Return a result of the body alone: mass, centre of gravity and tensor without the fixture's.

    The half-width of an interval adds, in squares, what the whole's and the fixture's errors do to the component, each
    with its own coverage factor.

    Args:
        result: of the body with its fixture.
        empty: of the fixture with the load cell's own moving plate.
        cross: covariance of the two's ten parameters, from errors that both have; None: they have none.

    Raises:
        RunError: a mass is not known, or the fixture is not lighter than the whole.
    """
    identified = empty if isinstance(empty, Identification) else None
    fixture = empty if isinstance(empty, InertialParameters) else empty.parameters
    whole = result.parameters
    body = subtract(whole, fixture, cross)
    half = _half_width(result, fixture, body, NORMAL if identified is None else _factor(identified))
    middle = body.inertia + _shift(result) - (0.0 if identified is None else _shift(identified))
    tare_warnings = () if identified is None else identified.warnings
    runs = () if identified is None else tuple((run.file, run.sha256) for run in identified.runs)
    fixture_text = f"the {'stated ' * (identified is None)}fixture ({fixture.mass:.4g} kg) is taken off"
    return replace(
        result,
        mass=body.mass,
        r_cg=body.r_cg,
        sigma_r_cg=body.standard_uncertainty[1:4],
        inertia=body.inertia,
        covariance=body.covariance[4:, 4:],
        interval95=np.stack([middle - half, middle + half], axis=1),
        bias=result.bias - (0.0 if identified is None else identified.bias),
        mass_uncertainty=float(body.standard_uncertainty[0]),
        mass_covariance=body.covariance[0, 1:],
        cg_covariance=body.covariance[1:4, 1:4],
        cg_inertia_covariance=body.covariance[1:4, 4:],
        warnings=(*result.warnings, *(f"tare: {text}" for text in tare_warnings)),
        assumptions=(*result.assumptions, fixture_text, *(SEPARATE,) * bool(runs)),
        tare=Tare(fixture, whole, runs, None if identified is None else dict(identified.provenance)),
    )


def lasting_errors(
    result: Identification, empty: Identification, loaded_centre: Centre, empty_centre: Centre
) -> Float[np.ndarray, "10 10"] | None:
    """Return the covariance of the ten parameters of two results through errors that both series of poses have.

    The declared alignment of the attitudes' sensor with the load cell is one and the same in both; it moves mass and
    centre of gravity, and by way of these the tensors.
    """
    lasting = loaded_centre.lasting, empty_centre.lasting
    if lasting[0] is None or lasting[1] is None or lasting[0].shape != lasting[1].shape:
        return None
    return _through(result, lasting[0]) @ _through(empty, lasting[1]).T


def _through(result: Identification, lasting: np.ndarray) -> np.ndarray:
    """Errors of a result's ten parameters from lasting errors (10, k) of its centre, (10, k)."""
    lasting = lasting[:4]
    covariance = result.parameters.covariance
    by_centre = covariance[4:, 1:4] @ np.linalg.pinv(covariance[1:4, 1:4], hermitian=True)
    return np.concatenate([lasting, by_centre @ lasting[1:]])


def _half_width(
    result: Identification, fixture: InertialParameters, body: InertialParameters, fixture_factor: np.ndarray | float
) -> np.ndarray:
    """Half of the interval of 95 % of each component [kg·m²]."""
    both = jnp.asarray(np.concatenate([result.parameters.values, fixture.values]))
    jacobian = np.asarray(jax.jacobian(left_over)(both))[4:]
    alone = [
        np.einsum("ij,jk,ik->i", by, parameters.covariance, by)
        for by, parameters in ((jacobian[:, :10], result.parameters), (jacobian[:, 10:], fixture))
    ]
    common = np.diag(body.covariance)[4:] - alone[0] - alone[1]
    square = _factor(result) ** 2 * alone[0] + fixture_factor**2 * alone[1] + NORMAL**2 * common
    return np.sqrt(np.maximum(square, 0.0))


def _shift(result: Identification) -> np.ndarray:
    """How far the middle of a result's intervals is from its value: expected errors of declared sources."""
    return result.interval95.mean(axis=1) - result.inertia


def _factor(result: Identification) -> np.ndarray:
    """The coverage factors of a result's intervals."""
    half, u = np.diff(result.interval95, axis=1)[:, 0] / 2, result.standard_uncertainty
    return np.divide(half, u, out=np.full(6, NORMAL), where=u > 0)

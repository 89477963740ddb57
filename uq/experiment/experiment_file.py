"""The tables of an experiment file together, and the small ones among them: body, estimators, scale, datum, fixture."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np

from identify.display.rounding import common
from identify.rigid_body.inertia import unpack
from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from identify.signals.estimator_spec import EstimatorSpec
from rig.exceptions import quoted
from rig.toml_tables import Name, TomlTable, WrongKeyError, written
from uq.experiment.calibration_table import CalibrationTable
from uq.experiment.platform_table import PlatformTable
from uq.experiment.pose_table import Poses
from uq.experiment.recording_table import RecordingTable
from uq.experiment.report_table import ReportTable
from uq.experiment.trajectory_table import HarmonicTable, MultisineTable, SphereTable
from uq.experiment.undeclared_table import UndeclaredTable
from uq.files.schema import ROTATION, Axes, Component, in_unit, vector
from uq.sources.correlations import LinkTable
from uq.sources.source_table import read_source

Metre = Annotated[float, in_unit("m")]
Moment = Annotated[float, in_unit("kg*m^2", above=0)]
Product = Annotated[float, in_unit("kg*m^2")]
SigmaOfInertia = Annotated[float, in_unit("kg*m^2", least=0)]


class TensorTable(TomlTable, frozen=True, kw_only=True):
    """A figure for each component of a tensor."""

    @property
    def packed(self) -> np.ndarray:
        """Return the array of I11, I12, I13, I22, I23, I33 [kg·m²]."""
        return np.array([getattr(self, name) for name in get_args(Component)])


class InertiaTable(TensorTable, frozen=True, kw_only=True):
    """A tensor about the centre of gravity, by its entries."""

    I11: Moment
    I22: Moment
    I33: Moment
    I12: Product = 0.0
    """The tensor's entry, -∫xy dm."""
    I13: Product = 0.0
    """The tensor's entry, -∫xz dm."""
    I23: Product = 0.0
    """The tensor's entry, -∫yz dm."""

    def __post_init__(self) -> None:
        """Refuse a tensor that no body has."""
        low, middle, high = np.linalg.eigvalsh(unpack(self.packed))
        if low <= 0 or low + middle < high * (1 - 1e-12):
            raise WrongKeyError(
                "",
                f"is no body's tensor (principal moments {', '.join(common((low, middle, high), 6))} kg*m^2): "
                "its moments must be positive and obey the triangle inequality",
            )


class InertiaUncertaintyTable(TensorTable, frozen=True, kw_only=True):
    """Standard uncertainties of a tensor's entries; zero where not stated."""

    I11: SigmaOfInertia = 0.0
    I12: SigmaOfInertia = 0.0
    I13: SigmaOfInertia = 0.0
    I22: SigmaOfInertia = 0.0
    I23: SigmaOfInertia = 0.0
    I33: SigmaOfInertia = 0.0


class ScaleTable(TomlTable, frozen=True, kw_only=True):
    """``[scale]``: the mass on the load cell as a scale shows it."""

    mass: Annotated[float, in_unit("kg", above=0)]
    """Reading of the scale."""
    standard_uncertainty: Annotated[float, in_unit("kg", above=0)]
    """Standard uncertainty of the scale's reading."""

    @property
    def value(self) -> tuple[float, float]:
        """The mass and its standard uncertainty [kg]."""
        return self.mass, self.standard_uncertainty


class DatumTable(TomlTable, frozen=True, kw_only=True):
    """``[datum]``: a frame fixed to the body in which the result is also wanted."""

    rotation_to_body: Annotated[np.ndarray, ROTATION] = msgspec.field(default_factory=lambda: np.eye(3))
    """Rotation from the datum's axes to the body's."""
    position: Axes[Metre] = (0.0, 0.0, 0.0)
    """The datum's origin from Q, in B."""
    sigma_rotation: Axes[Annotated[float, in_unit("rad", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the rotation about each axis."""
    sigma_position: Axes[Annotated[float, in_unit("m", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the position on each axis."""

    @property
    def value(self) -> Datum:
        """The frame with its covariance."""
        spread = np.square([*self.sigma_rotation, *self.sigma_position])
        return Datum(self.rotation_to_body.T, np.array(self.position), np.diag(spread))


class FixtureTable(TomlTable, frozen=True, kw_only=True):
    """``[fixture]``: a body that is to be subtracted from the identified one, from Q, in B."""

    mass: Annotated[float, in_unit("kg", above=0)]
    r_cg_from_q: Axes[Metre]
    """Centre of gravity of the fixture from Q, in B."""
    inertia: InertiaTable | None = None
    """Tensor of the fixture about its centre of gravity; without it the result has no tensor."""
    sigma_mass: Annotated[float, in_unit("kg", least=0)] = 0.0
    """Standard uncertainty of the fixture's mass."""
    sigma_r_cg: Axes[Annotated[float, in_unit("m", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the fixture's centre of gravity on each axis."""
    sigma_inertia: InertiaUncertaintyTable = InertiaUncertaintyTable()
    """Standard uncertainties of the fixture's tensor."""

    @property
    def value(self) -> InertialParameters:
        """The fixture's ten parameters with their covariance; a tensor of NaN: not stated."""
        tensor = np.full(6, np.nan) if self.inertia is None else self.inertia.packed
        spread = np.array([self.sigma_mass, *self.sigma_r_cg, *self.sigma_inertia.packed])
        return InertialParameters(self.mass, np.array(self.r_cg_from_q), tensor, np.diag(spread**2))


class BodyTable(TomlTable, frozen=True, kw_only=True):
    """``[body]``: the simulated body, or the centre of gravity of a recorded one."""

    r_cg_from_q: Annotated[np.ndarray, vector("m")] | None = None
    """Centre of gravity from the load cell's centre Q, in B; may be missing where static poses tell it."""
    mass: Annotated[float, in_unit("kg", above=0)] | None = None
    """Mass of the body."""
    inertia: InertiaTable | None = None
    """Tensor of the body about its centre of gravity."""


class EstimatorTable(TomlTable, frozen=True, kw_only=True):
    """``[[estimator]]``: an estimator of the tensor from a run."""

    name: Name
    """Name of the estimator in results and in other tables."""
    method: Literal["ols"] = "ols"
    """Method of the estimator: ``ols``, ordinary least squares."""
    differentiator: Literal["central", "savitzky-golay"]
    """Differentiator that computes the angular acceleration from the angular velocity."""
    band: Annotated[float, in_unit("Hz", above=0, most=1e6)] | None = None
    """Highest frequency of the motion, to which the differentiator is matched."""
    window: int | None = None
    """Points of the differentiator, an odd number; or state ``band``."""
    lowpass: Annotated[float, in_unit("Hz", above=0, most=1e6)] | None = None
    """Cut-off of a low pass that both sides of the regression go through."""

    def __post_init__(self) -> None:
        """Refuse a differentiator without a width."""
        if self.differentiator == "savitzky-golay" and self.band is None and self.window is None:
            raise WrongKeyError("band", "give the motion's highest frequency")
        if self.window is not None and (self.window < 5 or self.window % 2 == 0):
            raise WrongKeyError("window", "write an odd number of points, 5 or more")

    @property
    def spec(self) -> EstimatorSpec:
        """The estimator's specification for the computation, in SI."""
        return EstimatorSpec(
            name=self.name, differentiator=self.differentiator, band=self.band, window=self.window, lowpass=self.lowpass
        )


class ExperimentFile(TomlTable, frozen=True, kw_only=True):
    """An experiment file: a body on a platform with its sensors."""

    include: tuple[str, ...] = ()
    """Files of ``[[source]]`` tables, as `inertia noise` and `inertia calibrate` write them, whose sources count here;
    beside this file."""
    body: BodyTable | None = None
    platform: PlatformTable = PlatformTable()
    trajectory: Mapping[str, SphereTable | HarmonicTable | MultisineTable] = {}
    """Trajectories by their names."""
    estimator: tuple[EstimatorTable, ...] = ()
    source: tuple[Annotated[Any, written(read_source, {})], ...] = ()
    """Sources of error."""
    correlation: tuple[LinkTable, ...] = ()
    """Correlations between sources."""
    calibration: tuple[CalibrationTable, ...] = ()
    """Calibrations of the rig by known bodies, from the files that ``include`` names."""
    recording: RecordingTable = RecordingTable()
    undeclared: UndeclaredTable | Literal["none"] = UndeclaredTable()
    poses: Poses | None = None
    scale: ScaleTable | None = None
    datum: DatumTable | None = None
    fixture: FixtureTable | None = None
    report: ReportTable | None = None

    def __post_init__(self) -> None:
        """Refuse what one table alone does not show."""
        names = [estimator.name for estimator in self.estimator]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise WrongKeyError("", f"two entries named {quoted(twice)} in [[estimator]]: give each its own name")
        if (estimator := self.recording.estimator) not in (None, *names):
            unknown = f"unknown estimator {quoted(estimator)} at recording.estimator"
            raise WrongKeyError("", f"{unknown}: name one of [[estimator]]")
        mass = None if self.body is None else self.body.mass
        if mass is not None and self.scale is not None:
            read, sigma = self.scale.value
            if abs(mass - read) > 3 * sigma:
                raise WrongKeyError(
                    "", f"body.mass is {mass:g} kg, scale.mass {read:g} kg with {sigma:g} kg: keep the right one"
                )

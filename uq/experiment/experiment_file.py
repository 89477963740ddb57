"""The tables of an experiment file together, and the small ones among them: ``[body]``, ``[[estimator]]``."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np

from identify.signals.estimator_spec import EstimatorSpec
from rig.toml_tables import Name, TomlTable, WrongKeyError, written
from uq.experiment.platform_table import PlatformTable
from uq.experiment.pose_table import Poses
from uq.experiment.recording_table import RecordingTable
from uq.experiment.report_table import ReportTable
from uq.experiment.stated_values import DatumTable, FixtureTable, InertiaTable, ScaleTable
from uq.experiment.trajectory_table import HarmonicTable, MultisineTable, SphereTable
from uq.experiment.undeclared_table import UndeclaredTable
from uq.files.schema import in_unit, vector
from uq.sources.correlations import LinkTable
from uq.sources.source_table import WrittenSource, read_source


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
    """Files of ``[[source]]`` tables, as `inertia noise` writes them, whose sources count here; beside this file."""
    body: BodyTable | None = None
    platform: PlatformTable = PlatformTable()
    trajectory: Mapping[str, SphereTable | HarmonicTable | MultisineTable] = {}
    """Trajectories by their names."""
    estimator: tuple[EstimatorTable, ...] = ()
    source: tuple[Annotated[WrittenSource, written(read_source, {})], ...] = ()
    """Sources of error."""
    correlation: tuple[LinkTable, ...] = ()
    """Correlations between sources."""
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
            raise WrongKeyError("", f"two entries named '{twice}' in [[estimator]]: give each its own name")
        if self.recording.estimator not in (None, *names):
            raise WrongKeyError(
                "", f"unknown estimator '{self.recording.estimator}' at recording.estimator: name one of [[estimator]]"
            )
        mass = None if self.body is None else self.body.mass
        if mass is not None and self.scale is not None:
            read, sigma = self.scale.value
            if abs(mass - read) > 3 * sigma:
                raise WrongKeyError(
                    "", f"body.mass is {mass:g} kg, scale.mass {read:g} kg with {sigma:g} kg: keep the right one"
                )

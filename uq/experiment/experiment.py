"""Experiment files: TOML with units -> :class:`Experiment`.

Every physical value is a string with its unit. An unknown key, a bare number, a wrong dimension or a wrong length is an
:class:`ExperimentError` that names the key.
"""

import errno
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
from jaxtyping import Array, Float

from identify.display.reporting import Shown
from identify.display.text_tables import Table
from identify.motion.stewart_platform import StewartPlatform
from identify.motion.trajectory import Trajectory, sample
from identify.rigid_body.inertia import Body
from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from identify.signals.estimator_spec import EstimatorSpec
from rig.exceptions import choose, listed, quoted
from uq.experiment import experiment_tables
from uq.experiment.arm_table import DeclaredArm
from uq.experiment.calibration_table import CalibrationTable
from uq.experiment.experiment_file import BodyTable, ExperimentFile
from uq.experiment.platform_table import GEOMETRIES, DeclaredLimits
from uq.experiment.pose_table import Poses
from uq.experiment.recording_table import RecordingTable
from uq.experiment.report_table import refuse_claims
from uq.experiment.trajectory_table import MotionSamples, TrajectorySpec
from uq.experiment.undeclared_table import NONE, UndeclaredTable
from uq.files.document import in_file, read_document, with_entry, with_keys
from uq.files.mistakes import ExperimentError
from uq.files.provenance import plain_values
from uq.files.schema import declared_table
from uq.sources.constant_errors import declared_sigma
from uq.sources.draws import Mixing
from uq.sources.source import Source
from uq.sources.source_table import changed_source, sources_of, with_included, without_sources

PRESETS = ("barreto2016",)
BODY_NAME = re.compile(r"[A-Za-z0-9][\w-]{0,59}")
BESIDE = ("report", "document", "as_read", "folder", "file", "left_out")
"""Fields that say nothing of the measurement."""


@dataclass(frozen=True, repr=False)
class Experiment(Shown):
    """A body on a platform with its sensors: what is simulated, or how a recorded run is to be read."""

    r_cg_from_q: np.ndarray | None
    """Centre of gravity from the load cell's centre Q, in B [m]; None: not stated, for static poses to tell."""
    mass: float | None
    """Mass of the body [kg]; None: not stated."""
    inertia: np.ndarray | None
    """Packed tensor about the centre of gravity [kg·m²]; None: not stated."""
    gravity: float
    """Local gravity at the rig [m/s²]."""
    r_cg_from_omb: np.ndarray
    """Centre of gravity from the platform's centre, in B [m]."""
    trajectories: Mapping[str, TrajectorySpec]
    estimators: tuple[EstimatorSpec, ...]
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...] = ()
    """Sources that are correlated."""
    recording: RecordingTable = field(default_factory=RecordingTable)
    poses: Poses | None = None
    """Declaration of static poses; None: there are none."""
    geometry: StewartPlatform | None = None
    """The platform's six legs; None: not stated."""
    limits: DeclaredLimits | None = None
    """Limits of the rig; None: not stated."""
    arm: DeclaredArm | None = None
    """The robot arm that carries the body; None: another platform."""
    document: Mapping[str, Any] = field(default_factory=dict)
    """The file's content, for the provenance of results."""
    as_read: Mapping[str, Any] = field(default_factory=dict)
    """The content's values in SI: others, as after ``dataclasses.replace``, are not the file's."""
    folder: Path = Path(".")
    """Folder of the file, in which the files that it names are."""
    scale: tuple[float, float] | None = None
    """Mass on the load cell by a scale, and its standard uncertainty [kg]; None: there is none."""
    datum: Datum | None = None
    """A frame in which the result is also wanted; None: there is none."""
    fixture: InertialParameters | None = None
    """Fixture that is to be subtracted from the identified body, by its stated parameters; None: there is none."""
    calibrations: tuple[CalibrationTable, ...] = ()
    """Calibrations of the rig by known bodies: the means of their sources correct a result."""
    undeclared: UndeclaredTable = field(default_factory=UndeclaredTable)
    """Typical figures of errors that are not declared."""
    report: Mapping[str, Any] = field(default_factory=dict)
    """The table ``[report]`` as it stands, dates as strings; see :func:`uq.experiment.report_table.ReportTable`."""
    file: Mapping[str, str] = field(default_factory=dict)
    """Name and SHA-256 of the file; empty where there is none."""
    left_out: tuple[str, ...] = ()
    """Sources of the file that do not count here (:meth:`without_source`)."""

    @classmethod
    def load(cls, source: str | Path) -> "Experiment":
        """Read an experiment file, or a preset by its name (``barreto2016``).

        Raises:
            ExperimentError: the file is not TOML or its content is not an experiment.
            OSError: the file cannot be read.
        """
        document, file = _read(source)
        with in_file(source):
            return replace(cls.from_dict(document, Path(source).parent), file=file)

    @classmethod
    def load_bodies(cls, source: str | Path) -> dict[str, "Experiment"]:
        """Read an experiment file that may hold several bodies, ``[body.NAME]``: one experiment each, by its name.

        The only body of a file with ``[body]`` has the name ``""``.

        Raises:
            ExperimentError: as for :meth:`load`, or a name that is no folder's.
            OSError: the file cannot be read.
        """
        (document, file), folder = _read(source), Path(source).parent
        bodies = _bodies(document)
        for name in bodies:
            if not BODY_NAME.fullmatch(name):
                raise ExperimentError(f"[body.{name}] in {source}: write a name of at most 60 letters, digits, _ and -")
        with in_file(source):
            experiments = {name: cls.from_dict({**document, "body": body}, folder) for name, body in bodies.items()}
            experiments = experiments or {"": cls.from_dict(document, folder)}
            return {name: replace(experiment, file=file) for name, experiment in experiments.items()}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any], folder: str | Path = ".") -> "Experiment":
        """Build an experiment from the content of a file, beside the files that it names; see :meth:`load`."""
        if bodies := _bodies(document):
            raise ExperimentError(f"several bodies in [body] ({listed(bodies)}): this takes a file with one [body]")
        folder = Path(folder)
        document = with_included(document, folder)
        report = plain_values(document.get("report", {}))
        refuse_claims(report)
        file = declared_table("", _with_new_names(document), ExperimentFile)
        sources, mixing = sources_of(file.source, document.get("source", ()), file.correlation, folder)
        body, platform, recording = file.body or BodyTable(), file.platform, file.recording
        if recording.urdf is not None:
            recording = msgspec.structs.replace(recording, urdf=str(folder / recording.urdf))
        stated: dict[str, Any] = {name: getattr(file, name) for name in ("scale", "datum", "fixture")}
        stated = {name: None if table is None else table.value for name, table in stated.items()}
        experiment = cls(
            r_cg_from_q=body.r_cg_from_q, mass=body.mass, inertia=None if body.inertia is None else body.inertia.packed,
            gravity=platform.local_gravity,
            r_cg_from_omb=np.zeros(3) if platform.r_cg_from_omb is None else platform.r_cg_from_omb,
            trajectories={name: table.spec(name, folder) for name, table in file.trajectory.items()},
            estimators=tuple(table.spec for table in file.estimator), sources=sources, mixing=mixing,
            recording=recording, poses=file.poses, geometry=platform.legs,
            limits=None if platform.limits is None else platform.limits.limits, arm=platform.arm(folder),
            document=document, folder=folder, report=report, calibrations=file.calibration,
            undeclared=NONE if file.undeclared == "none" else file.undeclared, **stated,
        )  # fmt: skip
        return replace(experiment, as_read=experiment._in_si())

    @property
    def body(self) -> Body:
        """The body that a simulation moves.

        Raises:
            ExperimentError: mass or inertia are not stated.
        """
        for key in ("mass", "inertia"):
            if getattr(self, key) is None:
                raise self._missing(f"body.{key}", "a simulation needs it")
        return Body(*jax.device_put((self.mass, self.stated_r_cg, self.inertia)))

    def _missing(self, key: str, advice: str) -> ExperimentError:
        file = f" (in {self.file['file']})" if self.file else ""
        return ExperimentError(f"missing key {key}: {advice}{file}")

    @property
    def platform(self) -> StewartPlatform:
        """The platform's six legs.

        Raises:
            ExperimentError: they are not stated.
        """
        if self.geometry is None:
            raise ExperimentError(f"missing key platform.geometry: describe the legs, or name {', '.join(GEOMETRIES)}")
        return jax.device_put(self.geometry)

    @property
    def stated_r_cg(self) -> np.ndarray:
        """The centre of gravity from Q, in B [m].

        Raises:
            ExperimentError: it is not stated.
        """
        if self.r_cg_from_q is None:
            raise self._missing("body.r_cg_from_q", "add it; `inertia centre` finds it, --centre takes its result")
        return self.r_cg_from_q

    def estimator(self, name: str | None = None) -> EstimatorSpec:
        """Return an estimator by name; without one, the recording's, or the first.

        Raises:
            ExperimentError: there is no such estimator.
        """
        wanted = self.recording.estimator if name is None else name
        if not self.estimators:
            raise ExperimentError(
                "no [[estimator]] in the experiment: add one with name, differentiator and band, the motion's highest "
                "frequency"
            )
        if wanted is None:
            return self.estimators[0]
        for estimator in self.estimators:
            if estimator.name == wanted:
                return estimator
        names = [e.name for e in self.estimators]
        raise ExperimentError(f"unknown estimator {quoted(wanted)}: {choose(wanted, names)}")

    def select(self, name: str | None = None) -> tuple[str, TrajectorySpec]:
        """Return a trajectory's name and specification; without a name, the first.

        Raises:
            ExperimentError: there is no such trajectory.
        """
        if not self.trajectories:
            cure = "add one" if self.arm is None else "an arm's motion is designed and simulated by `inertia design`"
            raise ExperimentError(f"no [trajectory.NAME] in the experiment: {cure}")
        name = next(iter(self.trajectories)) if name is None else name
        if name not in self.trajectories:
            raise ExperimentError(f"unknown trajectory {quoted(name)}: {choose(name, self.trajectories)}")
        return name, self.trajectories[name]

    def motion(self, trajectory: str | None = None) -> MotionSamples:
        """Return what the body truly does on a trajectory, at the instants of its samples; without a name, the first.

        Raises:
            ExperimentError: there is no such trajectory, or no centre of gravity from the platform's centre.
        """
        _, spec = self.select(trajectory)
        t, from_still, gravity = jnp.asarray(samples(spec)), self.r_cg_from_still(spec), np.array(self.gravity)
        return MotionSamples.of(sample(spec.trajectory, t, r_cg_from_still=from_still, gravity=gravity))

    def r_cg_from_still(self, spec: TrajectorySpec) -> np.ndarray:
        """Return the centre of gravity from the point that keeps still on a trajectory, in B [m]."""
        return np.zeros(3) if spec.still == "cg" else self.r_cg_from_omb

    def selected_estimators(self, names: str | Sequence[str] | None) -> list[EstimatorSpec]:
        """Return the estimators of these names, without repeats; None for all.

        Raises:
            ExperimentError: there is none of a name, or none at all.
        """
        return [self.estimator(name) for name in _distinct(names)] or list(self.estimators) or [self.estimator()]

    def selected_trajectories(self, names: str | Sequence[str] | None) -> dict[str, TrajectorySpec]:
        """Return the trajectories of these names, without repeats; None for all.

        Raises:
            ExperimentError: there is none of a name, or none at all.
        """
        return dict([self.select(name) for name in _distinct(names) or self.trajectories] or [self.select()])

    def with_source(self, name: str, **keys: Any) -> "Experiment":
        """Return the experiment with other keys of a ``[[source]]``: ``with_source("F_bias", sigma="0.5 N")``.

        Values are written as in the file, with their units; a width takes the place of another. A new name with
        ``target``, ``kind``, ``group`` and a width adds a source.

        Raises:
            ExperimentError: an unknown name, a mistake in a key, or an experiment that is not its file's content.
        """
        return self._read_anew(with_entry(self.document, "source", name, keys, ("target", "kind"), changed_source))

    def without_source(self, *which: str) -> "Experiment":
        """Return the experiment without the sources of some names or kinds, and without what correlates them.

        A name may have spaces for its underscores, as tables print it. The result remembers what was left out.

        Raises:
            ExperimentError: as for :meth:`with_source`.
        """
        if not which:
            return self
        document, names = without_sources(self.document, self.sources, which)
        return replace(self._read_anew(document), file=self.file, left_out=(*self.left_out, *names))

    def with_body(self, **keys: Any) -> "Experiment":
        """Return the experiment with other keys of ``[body]``: ``with_body(mass="21 kg")``.

        Raises:
            ExperimentError: as for :meth:`with_source`.
        """
        return self._read_anew({**self.document, "body": with_keys(self.document.get("body", {}), keys)})

    def with_trajectory(self, name: str, **keys: Any) -> "Experiment":
        """Return the experiment with other keys of a ``[trajectory.NAME]``, or with a new one (``kind`` and the rest).

        Raises:
            ExperimentError: as for :meth:`with_source`.
        """
        return self._read_anew(with_entry(self.document, "trajectory", name, keys, ("kind",)))

    def with_estimator(self, name: str, **keys: Any) -> "Experiment":
        """Return the experiment with other keys of an ``[[estimator]]``, or with a new one (``differentiator``, …).

        Raises:
            ExperimentError: as for :meth:`with_source`.
        """
        return self._read_anew(with_entry(self.document, "estimator", name, keys, ("differentiator",)))

    def _read_anew(self, document: Mapping[str, Any]) -> "Experiment":
        if not self.is_of_document():
            raise ExperimentError("values that no keys state, as after dataclasses.replace: change keys before that")
        changed = Experiment.from_dict(document, self.folder)
        return replace(changed, left_out=tuple(n for n in self.left_out if n not in {s.name for s in changed.sources}))

    def is_of_document(self) -> bool:
        """Return whether its values are those of :attr:`document`."""
        return bool(self.document) and self.as_read == self._in_si()

    def inputs(self) -> dict[str, Any]:
        """Return what a result records of the experiment: its values in SI, and the file's content if these are its."""
        values = self._in_si()
        same = bool(self.document) and self.as_read == values
        about: dict[str, Any] = {"experiment_file": dict(self.file)} if self.file else {}
        about |= {"report": dict(self.report)} if self.report else {}
        about |= {"left_out": list(self.left_out)} if self.left_out else {}
        return {"experiment": plain_values(self.document) if same else None, "resolved": values, **about}

    def title(self) -> str:
        """Return what the tables are of."""
        changed = ", changed" if self.file and not self.is_of_document() else ""
        return f"Experiment {self.file.get('file', '')}{changed}".rstrip()

    def tables(self) -> list[Table]:
        """Return body, trajectories, estimators and sources, in units."""
        parameters = (self.mass, self.r_cg_from_q, self.inertia, self.r_cg_from_omb, self.gravity)
        tables = [
            experiment_tables.body_table(*parameters),
            experiment_tables.trajectory_table(self.trajectories),
            experiment_tables.estimator_table(self.estimators),
            experiment_tables.source_table(self.sources, self.document if self.is_of_document() else None),
        ]
        return [table for table in tables if table.rows]

    def _in_si(self) -> dict[str, Any]:
        parts = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in BESIDE}
        return plain_values(parts)

    @property
    def sigma_r_cg(self) -> np.ndarray:
        """Standard uncertainty of the centre of gravity on each axis [m], from the sources that perturb it."""
        return declared_sigma(self.sources, "r_cg")


def _distinct(names: str | Sequence[str] | None) -> list[str]:
    return list(dict.fromkeys([names] if isinstance(names, str) else names or []))


def _with_new_names(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The content with ``[not_included]``, an old name, as ``[undeclared]``; both together stay, and are refused."""
    if "undeclared" in document:
        return document
    return {"undeclared" if key == "not_included" else key: value for key, value in document.items()}


def _read(source: str | Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the content of an experiment file or preset, and its name with its SHA-256."""
    if str(source) in PRESETS:
        with resources.as_file(resources.files("uq").joinpath("presets", f"{source}.toml")) as preset:
            document, sha256 = read_document(preset, "a preset")
    else:
        if not Path(source).exists():
            raise FileNotFoundError(errno.ENOENT, "No experiment file, and no preset of the name", str(source))
        document, sha256 = read_document(source, "an experiment file")
    return document, {"file": str(source), "sha256": sha256}


def _bodies(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables ``[body.NAME]``; none where ``[body]`` is itself a body."""
    body = document.get("body")
    several = isinstance(body, Mapping) and bool(body) and all(isinstance(table, Mapping) for table in body.values())
    return dict(body) if isinstance(body, Mapping) and several and set(body) != {"inertia"} else {}


def samples(spec: TrajectorySpec) -> np.ndarray:
    """Return a trajectory's instants [s]: from 0, at its rate, ``duration * rate`` of them."""
    return np.arange(math.floor(spec.duration * spec.rate + 0.5)) / spec.rate


@jax.jit
def turn_rates(trajectory: Trajectory, t: Float[Array, " n"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Return angular velocity [rad/s] and angular acceleration [rad/s²] at some instants [s]."""
    return jax.vmap(trajectory.omega)(t), jax.vmap(trajectory.alpha)(t)

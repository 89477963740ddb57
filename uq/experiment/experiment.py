"""Experiment files: TOML with units -> :class:`Experiment`.

Every physical value is a string with its unit. An unknown key, a bare number, a wrong dimension or a wrong length is an
:class:`ExperimentError` that names the key.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from datetime import date, time
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import msgspec
import numpy as np

from identify.motion.stewart_platform import Platform
from identify.motion.trajectory import Harmonic, Multisine, Sphere, Trajectory
from identify.rigid_body.gravity import normal_gravity
from identify.rigid_body.inertia import Body
from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from identify.signals.estimator_spec import EstimatorSpec
from rig.toml_tables import TomlTable
from uq.experiment.multisine_table import read_multisine
from uq.experiment.platform_table import GEOMETRIES, DeclaredLimits, parse_geometry, parse_limits
from uq.experiment.pose_table import Poses
from uq.experiment.recording_table import Recording
from uq.experiment.report_table import parse_report
from uq.experiment.stated_values import DatumTable, FixtureTable, InertiaTable, ScaleTable
from uq.files.document import ExperimentError, Table, in_file, read_document
from uq.sources.source import Mixing, Source
from uq.sources.source_table import parse_sources

PRESETS = ("barreto2016",)
MOST_SAMPLES = 100_000_000
STATED: Mapping[str, Any] = {"scale": ScaleTable, "datum": DatumTable, "fixture": FixtureTable}
"""Tables that state a quantity with its standard uncertainty."""
BODY_NAME = re.compile(r"[A-Za-z0-9][\w-]*")
STANDARD_GRAVITY = 9.80665
"""Gravity where none is stated [m/s²]."""
BESIDE = ("report", "document", "folder", "file")
"""Fields that say nothing of the measurement."""
HIGHEST = 10_000.0
"""Height [m] beyond which no laboratory stands."""


@dataclass(frozen=True)
class TrajectorySpec:
    """A trajectory and how it is sampled and carried."""

    trajectory: Trajectory
    duration: float
    """Duration [s]."""
    rate: float
    """Sample rate of load cell and IMU [Hz]."""
    still: Literal["cg", "omb"]
    """The point that keeps still: the centre of gravity, or the platform's centre OMB."""


@dataclass(frozen=True)
class Experiment:
    """A body on a platform with its sensors: what is simulated, or how a recorded run is to be read."""

    r_cg_from_q: np.ndarray | None
    """Centre of gravity from the load cell's centre Q, in B [m]; None: not stated, for static poses to tell."""
    mass: float | None
    """Mass [kg]; None: not stated."""
    inertia: np.ndarray | None
    """Packed tensor about the centre of gravity [kg·m²]; None: not stated."""
    gravity: float
    """Local gravity [m/s²]."""
    r_cg_from_omb: np.ndarray
    """Centre of gravity from the platform's centre, in B [m]."""
    trajectories: Mapping[str, TrajectorySpec]
    estimators: tuple[EstimatorSpec, ...]
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...] = ()
    """Sources that are correlated."""
    recording: Recording = field(default_factory=Recording)
    poses: Poses | None = None
    """How static poses are declared; None: they are not."""
    geometry: Platform | None = None
    """The platform's six legs; None: not stated."""
    limits: DeclaredLimits | None = None
    """What the rig can do; None: not stated."""
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """The file's content, for the provenance of results."""
    folder: Path = field(default=Path("."), repr=False)
    """Where the file is, and beside it the files that it names."""
    scale: tuple[float, float] | None = None
    """What a scale says of the mass on the load cell, with its standard uncertainty [kg]; None: there is none."""
    datum: Datum | None = None
    """A frame in which the result is also wanted; None: there is none."""
    fixture: InertialParameters | None = None
    """What is to be subtracted from the identified body, by its stated parameters; None: nothing."""
    report: Mapping[str, Any] = field(default_factory=dict)
    """The table ``[report]`` as it stands, dates as strings; see :func:`uq.experiment.report_table.parse_report`."""
    file: Mapping[str, str] = field(default_factory=dict, repr=False)
    """Name and SHA-256 of the file; empty where there is none."""

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
                raise ExperimentError(f"[body.{name}] in {source}: write a name of letters, digits, _ and -")
        with in_file(source):
            experiments = {name: cls.from_dict({**document, "body": body}, folder) for name, body in bodies.items()}
            experiments = experiments or {"": cls.from_dict(document, folder)}
            return {name: replace(experiment, file=file) for name, experiment in experiments.items()}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any], folder: str | Path = ".") -> "Experiment":
        """Build an experiment from the content of a file, beside the files that it names; see :meth:`load`."""
        if bodies := _bodies(document):
            raise ExperimentError(f"several bodies in [body] ({', '.join(bodies)}): this takes a file with one [body]")
        top = Table("", document)
        poses = top.declared("poses", Poses) if "poses" in document else None
        r_cg_from_q, mass, inertia = _whole_body(top, stated=poses is None)
        gravity, r_cg_from_omb, geometry, limits = top.table("platform", _platform, {})
        trajectories = {
            name: _trajectory(Table(f"trajectory.{name}", value), Path(folder))
            for name, value in top.mapping("trajectory").items()
        }
        estimators = top.tables("estimator", _estimator)
        sources, mixing = parse_sources(top, Path(folder))
        recording = top.declared("recording", Recording, {})
        report = _plain(top.mapping("report"))
        parse_report(Table("report", report))
        if recording.urdf is not None:
            recording = msgspec.structs.replace(recording, urdf=str(Path(folder) / recording.urdf))
        more: dict[str, Any] = {
            name: top.declared(name, table).value for name, table in STATED.items() if top.raw(name, None) is not None
        }
        top.finish()
        _same_mass(mass, more.get("scale"))
        names = [estimator.name for estimator in estimators]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ExperimentError(f"two entries named '{twice}' in [[estimator]]: give each its own name")
        if recording.estimator is not None and recording.estimator not in names:
            raise ExperimentError(
                f"unknown estimator '{recording.estimator}' at recording.estimator: name one of [[estimator]]"
            )
        return cls(
            r_cg_from_q, mass, inertia, gravity, r_cg_from_omb, trajectories, estimators, sources, mixing, recording,
            poses, geometry, limits, document, Path(folder), report=report, **more,
        )  # fmt: skip

    @property
    def body(self) -> Body:
        """The body that a simulation moves.

        Raises:
            ExperimentError: mass or inertia are not stated.
        """
        for key in ("mass", "inertia"):
            if getattr(self, key) is None:
                raise ExperimentError(f"missing key body.{key}: a simulation needs it")
        return Body(jnp.asarray(self.mass), jnp.asarray(self.stated_r_cg), jnp.asarray(self.inertia))

    @property
    def platform(self) -> Platform:
        """The platform's six legs.

        Raises:
            ExperimentError: they are not stated.
        """
        if self.geometry is None:
            raise ExperimentError(f"missing key platform.geometry: describe the legs, or name {', '.join(GEOMETRIES)}")
        return jax.tree.map(jnp.asarray, self.geometry)

    @property
    def stated_r_cg(self) -> np.ndarray:
        """The centre of gravity from Q, in B [m].

        Raises:
            ExperimentError: it is not stated.
        """
        if self.r_cg_from_q is None:
            raise ExperimentError("missing key body.r_cg_from_q: add it; `inertia centre` finds it from static poses")
        return self.r_cg_from_q

    def estimator(self, name: str | None = None) -> EstimatorSpec:
        """Return an estimator by name; without one, the recording's, or the first.

        Raises:
            ExperimentError: there is no such estimator.
        """
        wanted = name or self.recording.estimator
        if not self.estimators:
            raise ExperimentError("no [[estimator]] in the experiment: add one")
        if wanted is None:
            return self.estimators[0]
        for estimator in self.estimators:
            if estimator.name == wanted:
                return estimator
        known = ", ".join(e.name for e in self.estimators)
        raise ExperimentError(f"unknown estimator '{wanted}': choose one of {known}")

    def select(self, name: str | None = None) -> tuple[str, TrajectorySpec]:
        """Return a trajectory's name and specification; without a name, the first.

        Raises:
            ExperimentError: there is no such trajectory.
        """
        if not self.trajectories:
            raise ExperimentError("no [trajectory.NAME] in the experiment: add one")
        name = next(iter(self.trajectories)) if name is None else name
        if name not in self.trajectories:
            raise ExperimentError(f"unknown trajectory '{name}': choose one of {', '.join(self.trajectories)}")
        return name, self.trajectories[name]

    def inputs(self) -> dict[str, Any]:
        """Return what a result records of the experiment: its values in SI, and the file's content if these are its."""
        values = self._in_si()
        same = bool(self.document) and Experiment.from_dict(self.document, self.folder)._in_si() == values
        about = {"experiment_file": dict(self.file)} if self.file else {}
        about |= {"report": dict(self.report)} if self.report else {}
        return {"experiment": _plain(self.document) if same else None, "resolved": values, **about}

    def _in_si(self) -> dict[str, Any]:
        parts = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in BESIDE}
        return _plain(parts)

    @property
    def sigma_r_cg(self) -> np.ndarray:
        """Standard uncertainty of the centre of gravity on each axis [m], from the sources that perturb it."""
        squares = [np.square(source.standard_deviation) for source in self.sources if source.target == "r_cg"]
        return np.sqrt(np.sum(squares, axis=0)) if squares else np.zeros(3)


def _same_mass(mass: float | None, scale: tuple[float, float] | None) -> None:
    """Refuse two masses that contradict each other."""
    if mass is not None and scale is not None and abs(mass - scale[0]) > 3 * scale[1]:
        raise ExperimentError(
            f"body.mass is {mass:g} kg, scale.mass {scale[0]:g} kg with {scale[1]:g} kg: keep the right one"
        )


def _read(source: str | Path) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the content of an experiment file or preset, and its name with its SHA-256."""
    if str(source) in PRESETS:
        with resources.as_file(resources.files("uq").joinpath("presets", f"{source}.toml")) as preset:
            document, sha256 = read_document(preset, "a preset")
    else:
        document, sha256 = read_document(source, "an experiment file")
    return document, {"file": str(source), "sha256": sha256}


def _bodies(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables ``[body.NAME]``; none where ``[body]`` is itself a body."""
    body = document.get("body")
    several = isinstance(body, Mapping) and bool(body) and all(isinstance(part, Mapping) for part in body.values())
    return dict(body) if isinstance(body, Mapping) and several and set(body) != {"inertia"} else {}


def _whole_body(top: Table, *, stated: bool) -> tuple[np.ndarray | None, float | None, np.ndarray | None]:
    """The table ``[body]``; where static poses are declared, it and its centre of gravity may be missing."""
    if stated or "r_cg_from_q" in top.mapping("body"):
        return top.table("body", _body)
    _, mass, inertia = _body(Table("body", {"r_cg_from_q": ["0 m"] * 3, **top.mapping("body")}))
    return None, mass, inertia


def _body(table: Table) -> tuple[np.ndarray, float | None, np.ndarray | None]:
    r_cg = table.vector("r_cg_from_q", "m")
    mass = table.quantity("mass", "kg", None, positive=True)
    inertia = table.declared("inertia", InertiaTable).packed if "inertia" in table.content else None
    table.finish()
    return r_cg, mass, inertia


def _platform(table: Table) -> tuple[float, np.ndarray, Platform | None, DeclaredLimits | None]:
    gravity = _gravity(table)
    r_cg_from_omb = table.vector("r_cg_from_omb", "m", ["0 m", "0 m", "0 m"])
    geometry = parse_geometry(table)
    limits = table.table("limits", parse_limits) if "limits" in table.content else None
    table.finish()
    return gravity, r_cg_from_omb, geometry, limits


def _gravity(table: Table) -> float:
    """Local gravity: its value, or that of the ellipsoid at a latitude and height."""
    if isinstance(table.content.get("gravity"), Mapping):
        return table.table("gravity", _of_place)
    return table.quantity("gravity", "m/s^2", STANDARD_GRAVITY, positive=True)


def _of_place(table: Table) -> float:
    latitude, height = table.quantity("latitude", "rad"), table.quantity("height", "m", 0.0)
    table.finish()
    if abs(latitude) > math.pi / 2:
        raise ExperimentError(f"{table.path('latitude')} is {table.content['latitude']!r}: write -90 deg to 90 deg")
    if abs(height) > HIGHEST:
        raise ExperimentError(f"{table.path('height')} is {table.content['height']!r}: write a height on the earth")
    return normal_gravity(latitude, height)


def _trajectory(table: Table, folder: Path) -> TrajectorySpec:
    kind = table.choice("kind", ("sphere", "harmonic", "multisine"))
    still = table.choice("still", ("cg", "omb"), "omb" if kind == "multisine" else "cg")
    duration = table.quantity("duration", "s", positive=True)
    rate = table.quantity("rate", "Hz", positive=True)
    ramp = table.quantity("ramp", "s", positive=True)
    segment = duration / 3 if kind == "harmonic" else duration
    if 2 * ramp > segment:
        raise ExperimentError(
            f"{table.path('ramp')} is {ramp:g} s: at most half of the {segment:g} s that a motion lasts"
        )
    if duration * rate > MOST_SAMPLES:
        raise ExperimentError(f"{table.where} has more than {MOST_SAMPLES:,} samples: lower duration or rate")
    if round(duration * rate) < 2:
        raise ExperimentError(f"{table.where} has fewer than two samples: raise duration or rate")
    ends = {"duration": np.array(duration), "ramp": np.array(ramp)}
    trajectory = _multisine(table, folder, ends, still) if kind == "multisine" else _of_the_source(table, kind, ends)
    table.finish()
    return TrajectorySpec(trajectory, duration, rate, still)


def _of_the_source(table: Table, kind: str, common: Mapping[str, np.ndarray]) -> Trajectory:
    speeds = {"angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
    values = {**common, **{key: np.array(table.quantity(key, unit, positive=True)) for key, unit in speeds.items()}}
    if kind == "harmonic":
        return Harmonic(**values)
    precessions = np.array(float(table.typed("precessions", int)))
    pole = ("b1", "b2", "b3").index(table.choice("pole", ("b1", "b2", "b3"), "b2"))
    return Sphere(**values, precessions=precessions, pole=pole)


def _multisine(table: Table, folder: Path, common: Mapping[str, np.ndarray], still: str) -> Multisine:
    if still == "cg":
        raise ExperimentError(f'{table.path("still")} is "cg": a multisine carries the platform\'s centre, write "omb"')
    return read_multisine(table.path("amplitudes"), folder / table.typed("amplitudes", str), **common)


def _estimator(table: Table) -> EstimatorSpec:
    name = table.typed("name", str)
    table.choice("method", ("ols",), "ols")
    differentiator = table.choice("differentiator", ("central", "savitzky-golay"))
    band, lowpass = (table.quantity(key, "Hz", None, positive=True) for key in ("band", "lowpass"))
    window = table.typed("window", int, None)
    table.finish()
    if differentiator == "savitzky-golay" and band is None and window is None:
        raise ExperimentError(f"missing key {table.path('band')}: give the motion's highest frequency")
    if window is not None and (window < 5 or window % 2 == 0):
        raise ExperimentError(f"{table.path('window')} is {window}: write an odd number of points, 5 or more")
    return EstimatorSpec(name, differentiator, band, window, lowpass)


def _plain(value: Any) -> Any:
    """Return a value as numbers, strings, lists and dicts, for JSON."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, TomlTable):
        return {"class": type(value).__name__} | _plain(value.to_dict())
    if is_dataclass(value):
        return {"class": type(value).__name__} | {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (date, time)):
        return value.isoformat()
    if isinstance(value, (np.ndarray, np.generic, jax.Array)):
        return _plain(np.asarray(value).tolist())
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def samples(spec: TrajectorySpec) -> np.ndarray:
    """Return a trajectory's instants [s]: from 0, at its rate, ``duration * rate`` of them."""
    return np.arange(math.floor(spec.duration * spec.rate + 0.5)) / spec.rate

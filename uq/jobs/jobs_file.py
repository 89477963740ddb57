"""A file of jobs: bodies with their runs and experiments, as ``inertia identify --jobs`` takes it."""

import glob
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import msgspec

from identify.estimation import methods
from rig.exceptions import listed, quoted
from rig.toml_tables import TomlTable, WrongKeyError
from uq.bodies import export_formats
from uq.experiment.experiment import BODY_NAME, PRESETS
from uq.files.document import in_file, read_document
from uq.files.mistakes import ExperimentError
from uq.files.schema import declared_table


class JobKeys(TomlTable, frozen=True, kw_only=True):
    """Keys of all jobs at the top of the file, and of one in its table, which goes before."""

    experiment: str | None = None
    """Experiment file, beside this one; or the preset barreto2016."""
    method: str | None = None
    """Method of estimation: source, gls or joint; missing: the experiment's."""
    centre: str | None = None
    """File centre.json with mass and centre of gravity from static poses."""
    tare: tuple[str, ...] | None = None
    """Runs of the fixture alone, which is taken off; paths, or patterns such as ``empty/*.mcap``."""
    mounting: tuple[str, ...] | None = None
    """Name of the mounting of each run, in the order of the runs."""
    expected: str | None = None
    """File of a reference body with which the result is compared."""
    export: tuple[str, ...] | None = None
    """Export formats, such as ``urdf``."""

    def __post_init__(self) -> None:
        """Refuse a method or a format that there is not."""
        if self.method is not None and self.method not in methods.names():
            raise WrongKeyError("method", f"choose one of {listed(methods.names())}")
        if self.mounting is not None and not all(name.strip() for name in self.mounting):
            raise WrongKeyError("mounting", "give a name for each run")
        try:
            export_formats.chosen(self.export or export_formats.names()[:1])
        except ExperimentError as error:
            problem, _, advice = str(error).partition(": ")
            raise WrongKeyError("export", advice, f"has an {problem}") from None


class JobTable(JobKeys, frozen=True, kw_only=True):
    """``[[job]]``: one body with its runs."""

    name: str
    """Name of the job, and of its folder: at most 60 letters, digits, _ and -."""
    runs: tuple[str, ...]
    """Recorded runs of the body, beside this file; paths, or patterns such as ``disc-*.mcap``."""

    def __post_init__(self) -> None:
        """Refuse a name that is no folder's, and a job without runs."""
        super().__post_init__()
        if not BODY_NAME.fullmatch(self.name):
            raise WrongKeyError("name", "write a name of at most 60 letters, digits, _ and -")
        if not self.runs:
            raise WrongKeyError("runs", "name the body's recorded runs")


class JobsFile(JobKeys, frozen=True, kw_only=True):
    """A file of jobs; keys above the first ``[[job]]`` hold for each job that does not state them."""

    job: tuple[JobTable, ...]
    """Jobs, one body each."""

    def __post_init__(self) -> None:
        """Refuse jobs that would share a folder, and jobs without an experiment."""
        super().__post_init__()
        if not self.job:
            raise WrongKeyError("job", "write a table [[job]] for each body")
        folders = [job.name.casefold() for job in self.job]
        if twice := [job.name for job in self.job if folders.count(job.name.casefold()) > 1]:
            raise WrongKeyError("", f"two jobs named {quoted(twice[-1])}: give each its own name")
        bare = [job.name for job in self.job if job.experiment is None]
        if self.experiment is None and bare:
            raise WrongKeyError("", f"missing key job[{bare[0]}].experiment: add it, or one for all above [[job]]")


@dataclass(frozen=True, kw_only=True)
class Job:
    """One body: its runs and what is wanted of them, with paths from the working folder."""

    name: str
    runs: tuple[str, ...]
    """Paths, or patterns of them."""
    experiment: str
    method: str | None = None
    centre: str | None = None
    tare: tuple[str, ...] = ()
    mounting: tuple[str, ...] | None = None
    expected: str | None = None
    export: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the values by their names, for another process."""
        return asdict(self)


def load_jobs(path: str | Path) -> list[Job]:
    """Return the jobs of a file.

    Raises:
        ExperimentError: it is not TOML, or a key is missing, unknown or wrong.
        OSError: it cannot be read.
    """
    document, _ = read_document(path, "a file of jobs")
    with in_file(path):
        file = declared_table("", document, JobsFile)
    return [_job(table, file, Path(path).parent) for table in file.job]


def _job(table: JobTable, file: JobsFile, folder: Path) -> Job:
    """A job with what the file says of all, its paths beside the file."""
    stated: dict[str, Any] = {field: getattr(file, field) for field in JobKeys.__struct_fields__}
    stated |= {key: value for key, value in msgspec.structs.asdict(table).items() if value is not None}
    experiment = stated.pop("experiment")
    stated["experiment"] = experiment if experiment in PRESETS else str(folder / experiment)
    for key in ("centre", "expected"):
        stated[key] = None if stated[key] is None else str(folder / stated[key])
    for key in ("runs", "tare"):
        stated[key] = tuple(str(folder / path) for path in stated[key] or ())
    return Job(**stated | {"export": stated["export"] or ()})


def paths_of(patterns: tuple[str, ...]) -> Iterator[str]:
    """Yield the paths that patterns stand for, those of one in order; a path that exists stands for itself.

    A pattern that no file matches stands for itself, too, so that whoever opens it says what is missing.
    """
    for pattern in patterns:
        matches = [] if Path(pattern).exists() else sorted(glob.glob(pattern, recursive=True))
        yield from matches or [pattern]

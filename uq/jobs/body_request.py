"""A request for one body, by the command's options or by a job: its tensor, compared and exported."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Optional

from identify.choices import OffsetChoice
from identify.display.reporting import Result
from identify.results.identification_result import Identification
from uq.bodies import export_formats
from uq.experiment.experiment import Experiment
from uq.progress_bar import Progress
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.tare import check_tare, tare_files
from uq.runs.recorded.time_window import TimeWindow

if TYPE_CHECKING:
    from uq.bodies.reference import Reference


@dataclass(frozen=True, kw_only=True)
class BodyRequest:
    """Runs of one body, and what is wanted of them; as the options of ``inertia identify``."""

    runs: Sequence[str | Path]
    experiment_file: str
    """An experiment file, or a preset."""
    estimator: str | None = None
    offsets: OffsetChoice | None = None
    method: str | None = None
    windows: Sequence[TimeWindow] | None = None
    mountings: Sequence[str] | None = None
    centre: str | Path | None = None
    tare: Sequence[str | Path] = ()
    tare_centre: str | Path | None = None
    expected: str | Path | None = None
    """File of a reference body; None: the result is compared with none."""
    formats: Sequence[str] = ()
    """Names of export formats; empty: nothing is exported."""
    force: bool = False
    """Whether even a tensor that the runs contradict is exported."""
    validate: bool = False
    processes: int | None = None
    """Most processes among which many runs are shared; None: as many as there are processors."""

    @cached_property
    def experiment(self) -> Experiment:
        """The experiment, read."""
        return Experiment.load(self.experiment_file)

    @cached_property
    def reference(self) -> Optional["Reference"]:
        """The reference body, read."""
        if self.expected is None:
            return None
        from uq.bodies.reference import load_reference

        return load_reference(self.expected)

    def check(self) -> None:
        """Read all but the runs, so that a mistake shows before any work is done.

        Raises:
            ExperimentError, RigError, RunError, OSError: a mistake in a file, an unknown format, a tare that cannot be.
        """
        if self.formats:
            export_formats.chosen(self.formats)
        _ = self.experiment, self.reference
        check_tare(self.tare, self.experiment, self.tare_centre, self.method)

    def identified(self, progress: Progress | None = None) -> Identification:
        """Return the tensor of the body, without its fixture; ``progress`` is called as by ``identify_files``.

        Raises:
            ExperimentError, RigError, RunError: see :func:`uq.runs.identification.identify_files.identify_files` and
                :func:`uq.runs.identification.tare.tare_files`.
        """
        result = identify_files(
            self.runs, self.experiment, windows=self.windows, mountings=self.mountings, centre=self.centre,
            validate=self.validate, estimator=self.estimator, offsets=self.offsets, method=self.method,
            processes=self.processes, progress=progress,
        )  # fmt: skip
        return tare_files(
            result, self.tare, self.experiment, tare_centre=self.tare_centre,
            estimator=self.estimator, offsets=self.offsets, method=self.method,
        )  # fmt: skip

    def compared(self, result: Identification) -> list[Result]:
        """Return the result beside the reference body, where there is one."""
        if self.reference is None:
            return []
        from uq.bodies.comparison import compare

        return [compare(result, self.reference)]

    def exported(self, result: Identification) -> list[Result]:
        """Return the export files, where any are wanted.

        Raises:
            RunError: see :func:`uq.bodies.export.export`.
        """
        if not self.formats:
            return []
        from uq.bodies.export import export

        return [export(result, self.formats, force=self.force)]

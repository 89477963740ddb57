"""Identification of many bodies, a folder each: the function behind ``inertia identify --jobs``."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rig.child_process import processors
from uq.files.mistakes import ExperimentError
from uq.jobs.job_result import JobResult
from uq.jobs.job_work import failed, work
from uq.jobs.jobs_file import Job, load_jobs
from uq.jobs.summary import write_summary
from uq.processes.process_pool import Answer, ProcessPool
from uq.progress_bar import Progress, progress_of

OUT_OF_MEMORY = "out of memory: give this process more, run fewer with --processes, or take shorter runs"


def identify_jobs(
    path: str | Path,
    out: str | Path,
    *,
    processes: int | None = None,
    progress: Progress | bool | None = None,
) -> Iterator[JobResult]:
    """Identify the bodies of a file of jobs, each in a folder of its own; yield how each went as it ends.

    A job that fails costs no other, nor does one whose process dies. What was made from the same runs, experiment and
    options by this version is kept. After the last job ``summary.csv`` and ``summary.html`` are written.

    Args:
        path: the file of jobs.
        out: folder of the jobs' folders.
        processes: most processes at a time; None: as many as there are cores.
        progress: called with "jobs", those done and all; True: a bar.

    Raises:
        ExperimentError: a mistake in the file of jobs, seen before any work is done.
        OSError: the file cannot be read, or the folder not written.
    """
    jobs, folder = load_jobs(path), Path(out)
    if processes is not None and processes < 1:
        raise ExperimentError(f"{processes} processes: give 1 or more")
    folder.mkdir(parents=True, exist_ok=True)
    return _results(jobs, folder, processes or processors(), progress_of(progress, "jobs"))


def _results(jobs: Sequence[Job], out: Path, processes: int, progress: Progress) -> Iterator[JobResult]:
    results: dict[str, JobResult] = {}
    progress("jobs", 0, len(jobs))
    with ProcessPool(min(processes, len(jobs))) as pool:
        for answer in pool.answers(partial(work, out=out), jobs):
            job, outcome = jobs[answer.number], _outcome(answer)
            folder = None if outcome["status"] == "failed" else out / job.name
            results[job.name] = result = JobResult(name=job.name, folder=folder, **outcome)
            progress("jobs", len(results), len(jobs))
            yield result
    write_summary([results[job.name] for job in jobs], out)


def _outcome(answer: Answer) -> dict[str, Any]:
    """Return how a job went; a fault of this program in one job, or the end of its process, costs no other."""
    if answer.died:
        return failed(answer.died.replace("(out of memory?)", "(out of memory? run fewer with --processes)"))
    if answer.error is None:
        return dict(answer.value)
    text = f"{type(answer.error).__name__}: {answer.error}"
    short = isinstance(answer.error, MemoryError) or "RESOURCE_EXHAUSTED" in text
    return failed(OUT_OF_MEMORY if short else f"a fault of this program: {text}")

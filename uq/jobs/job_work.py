"""One job in a process of its own: it is identified, or kept where its folder was made from the same inputs."""

import json
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from identify.exceptions import RunError
from rig.exceptions import cure, on_one_line
from uq.files.mistakes import MISTAKES
from uq.jobs.body_request import BodyRequest
from uq.jobs.job_folder import MADE_FROM, appearing, changed, inputs_of, record_of, refuse_strangers, tidy
from uq.jobs.jobs_file import Job, paths_of
from uq.report.certificate.certificate import Certificate
from uq.report.report_files import write
from uq.report.tables.identification import verdict_word


def work(job: Job, out: Path) -> dict[str, str]:
    """Return how a job went: ``status`` (done, kept, failed), ``verdict``, ``line`` and ``note``.

    A user's mistake is the line of a job that failed.
    """
    folder = out / job.name
    try:
        tidy(folder)
        return _worked(job, folder)
    except MISTAKES as error:
        return failed(str(error))
    except OSError as error:
        where = f" {error.filename}" if error.filename is not None else ""
        return failed(f"{error.strerror or error}{where}: {cure(error)}")


def failed(line: str) -> dict[str, str]:
    """Return what is said of a job that failed, in one line."""
    return {"status": "failed", "verdict": "failed", "line": on_one_line(line), "note": ""}


def _worked(job: Job, folder: Path) -> dict[str, str]:
    request = BodyRequest(
        runs=list(paths_of(job.runs)), experiment_file=job.experiment, method=job.method, mountings=job.mounting,
        centre=job.centre, tare=list(paths_of(job.tare)), expected=job.expected, formats=job.export,
        processes=1,
    )  # fmt: skip
    refuse_strangers(folder)
    request.check()
    inputs, before = inputs_of(request, _version()), record_of(folder)
    other = "" if before is None else changed(before["inputs"], inputs)
    if before is not None and not other:
        return {"status": "kept", "verdict": before["verdict"], "line": before["line"], "note": ""}
    result = request.identified()
    more, line = request.compared(result), ""
    try:
        more += request.exported(result)
    except RunError as error:  # the result stands; who wants the files all the same exports them by hand
        line = on_one_line(f"not exported: {error}")
    verdict = verdict_word(result)
    record = {"inputs": inputs, "verdict": verdict, "line": line}
    with appearing(folder) as new:
        _write(new, Certificate(result), more, record)
    note = f"{job.name}: replaced, since what it was made from has changed: {other}" if other else ""
    return {"status": "done", "verdict": verdict, "line": line, "note": note}


def _write(folder: Path, certificate: Certificate, more: list[Any], record: Mapping[str, Any]) -> None:
    """Write a job's files; figures as matplotlib draws them by itself."""
    import matplotlib

    with matplotlib.rc_context(matplotlib.rcParamsDefault):
        write(certificate, folder, *more)
    (folder / MADE_FROM).write_text(json.dumps(record, indent=1), "utf-8")


def _version() -> str:
    try:
        return version("inertia-uq")
    except PackageNotFoundError:
        return "unknown"

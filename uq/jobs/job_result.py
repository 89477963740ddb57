"""The outcome of a job, for a script to test."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from uq.jobs.job_folder import RESULT


@dataclass(frozen=True, kw_only=True)
class JobResult:
    """The outcome of a job.

    Example: ``all(job.verdict == "not contradicted" for job in identify_jobs("jobs.toml", "night"))``.
    """

    name: str
    status: Literal["done", "kept", "failed"]
    """``kept``: its folder was made from the same inputs before."""
    verdict: Literal["not contradicted", "warnings", "contradicted", "failed"]
    """Verdict of the certificate: ``warnings`` are to be read before the figures are used."""
    line: str = ""
    """Reason of the failure, or why nothing was exported; '': neither."""
    note: str = ""
    """Inputs that had changed, so that the folder was replaced; '': none."""
    folder: Path | None = None
    """Folder of the result; None: the job failed."""

    def content(self) -> dict[str, Any]:
        """Return the content of result.json, in SI; {}: the job failed."""
        return {} if self.folder is None else dict(json.loads((self.folder / RESULT).read_text("utf-8")))

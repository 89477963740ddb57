"""One table of all jobs: as CSV, in SI, and as a page with links to the jobs' reports."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from identify.display.reporting import Section
from identify.display.rounding import decimals, fixed
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.files.output_folder import place
from uq.files.provenance import provenance
from uq.jobs.job_result import JobResult
from uq.report.page import html

NAMES = ("summary.csv", "summary.html")
ATTENTION = {
    "contradicted": "the runs contradict what is declared",
    "warnings": "read the warnings of its report",
    "failed": "there is no result",
}
HALF = "± is half the 95 % interval, by measured and declared errors. Conventional bounds stand in the reports."


def write_summary(results: Sequence[JobResult], out: Path) -> None:
    """Write ``summary.csv`` and ``summary.html``. Raises OSError: the folder cannot be written."""
    contents = [result.content() for result in results]
    page = html(_section(results, contents), [], "")
    place({NAMES[0]: _csv(results, contents).encode(), NAMES[1]: page.encode()}, out)


def table(results: Sequence[JobResult], *, linked: bool = False) -> Table:
    """Return the table of all jobs; ``linked``: names lead to their reports."""
    return _table(results, [result.content() for result in results], linked=linked)


def _table(results: Sequence[JobResult], contents: Sequence[dict[str, Any]], *, linked: bool) -> Table:
    head = ["job", "verdict", *(f"{name}, g·m²" for name in COMPONENTS), "mass, kg", "runs", "warnings"]
    rows = [_row(result, content, linked=linked) for result, content in zip(results, contents, strict=True)]
    return Table(caption(results), head, rows, HALF)


def caption(results: Sequence[JobResult]) -> str:
    """Return how many jobs there are of each verdict."""
    verdicts = [result.verdict for result in results]
    counts = [f"{verdicts.count(word)} {word}" for word in dict.fromkeys(sorted(verdicts))]
    return f"{len(results)} job{'s' * (len(results) != 1)}: {', '.join(counts)}"


def findings(results: Sequence[JobResult]) -> list[str]:
    """Return a line of each job that failed, or whose figures are in doubt."""
    return [
        f"{result.name}: {'; '.join(filter(None, (ATTENTION.get(result.verdict), result.line)))}"
        for result in results if result.line or result.verdict in ATTENTION
    ]  # fmt: skip


def _row(result: JobResult, content: dict[str, Any], *, linked: bool) -> list[str]:
    if result.folder is None:
        return [result.name, result.verdict, *["–"] * 9]
    name = Markup('<a href="{0}/report.html">{0}</a>').format(result.name) if linked else result.name
    tensor = [_figure(content["inertia"][k], content["interval95"][k], GRAM_METRE) for k in COMPONENTS]
    mass = _figure(content["mass"]["value"], content["mass"]["interval95"], 1.0)
    counts = [str(len(content[key])) for key in ("runs", "warnings")]
    return [name, result.verdict, *tensor, mass, *counts]


def _figure(value: float | None, ends: Sequence[float | None] | None, unit: float) -> str:
    """Figure ± half its interval; – where it is not known."""
    half = _half(ends)
    if value is None:
        return "–"
    if half is None:
        return f"{unit * value:.6g}"
    places = decimals(unit * half)
    return f"{fixed(unit * value, places)} ± {fixed(unit * half, places)}"


def _half(ends: Sequence[float | None] | None) -> float | None:
    """Half an interval; None: there is none."""
    if ends is None or ends[0] is None or ends[1] is None or not ends[1] > ends[0]:
        return None
    return (ends[1] - ends[0]) / 2


def _csv(results: Sequence[JobResult], contents: Sequence[dict[str, Any]]) -> str:
    figures = [*(f"{name}_kg_m2" for name in COMPONENTS), "mass_kg"]
    names = [name for figure in figures for name in (figure, f"half_width95_{figure}")]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["job", "status", "verdict", *names, "runs", "warnings", "report", "remark"])
    for result, content in zip(results, contents, strict=True):
        cells: list[Any] = [""] * (len(names) + 3)
        if content:
            pairs = [(content["inertia"][k], content["interval95"][k]) for k in COMPONENTS]
            pairs.append((content["mass"]["value"], content["mass"]["interval95"]))
            cells = [cell for value, ends in pairs for cell in (value, _half(ends))]
            cells += [len(content["runs"]), len(content["warnings"]), f"{result.name}/report.html"]
        writer.writerow([result.name, result.status, result.verdict, *cells, result.line])
    return text.getvalue()


def _section(results: Sequence[JobResult], contents: Sequence[dict[str, Any]]) -> Section:
    runs = [
        [result.name, result.status, run["file"], run["sha256"]]
        for result, content in zip(results, contents, strict=True)
        for run in content.get("provenance", {}).get("inputs", [])
    ]
    return Section(
        title="Inertia tensors of many bodies", findings=findings(results),
        tables=[_table(results, contents, linked=True)],
        details=[Table("Runs of each job", ["job", "status", "file", "SHA-256"], runs, wrap=True)],
        assumptions=["Each job's report states its own."], provenance=provenance(),
    )  # fmt: skip

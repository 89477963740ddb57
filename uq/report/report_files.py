"""A result's files: its report, its JSON and its figures, in a folder."""

from pathlib import Path
from typing import Any

from identify.display.reporting import Result, Section
from uq.files.output_folder import place
from uq.report.page import drawn, html, joined, json_text, number, rendered


def report(result: Any) -> str:
    """Return a result's report: an HTML page with its style and figures inside, which loads nothing from elsewhere.

    Example: ``Path("report.html").write_text(report(montecarlo(Experiment.load("barreto2016"), trials=100)))``.

    Raises:
        TypeError: there is no report for this kind of result.
    """
    section = joined(_section(result))
    return html(section, drawn(section.drawings), number(section, result.to_dict()))


def write(result: Any, out: Path, *more: Any) -> None:
    """Write ``result.json`` (``centre.json`` of a centre), ``report.html`` and the figures (SVG and PNG) into a folder.

    What ``more`` results say, such as a budget, joins the same report and JSON; a CSV and other files that a result
    brings stand beside them.

    Everything is made before the first file is moved into place, so that a failure leaves no half-written file. A file
    of the same name is replaced; other files stay.

    Example: ``write(montecarlo(Experiment.load("barreto2016"), trials=100), Path("out"))``.

    Raises:
        OSError: the folder cannot be made or written.
        TypeError: there is no report for this kind of result.
    """
    place(files(result, *more), out)


def files(result: Any, *more: Any) -> dict[str, bytes]:
    """Return the content of a result's files by name, together with that of ``more``."""
    section = joined(*map(_section, (result, *more)))
    figures = drawn(section.drawings)
    content = result.to_dict() | {other.name: other.to_dict() for other in more}
    name = number(section, content)
    return {
        result.file_name: json_text(content | ({"certificate": name} if name else {})).encode(),
        "report.html": html(section, figures, name).encode(),
        **{file: data for part in (result, *more) for file, data in part.files().items()},
        **{f"{figure.name}.svg": figure.svg for figure in figures},
        **{f"{figure.name}.png": rendered(figure.figure, "png") for figure in figures},
    }


def _section(result: Any) -> Section:
    if not isinstance(result, Result):
        raise TypeError(f"Argument `result` must be a result with a report, but is a {type(result).__name__}.")
    return result.section()

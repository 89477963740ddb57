"""Reports: one HTML page that stands alone, and a result's files in a folder.

What a page says of which result is in :mod:`uq.report.pages`; here it is laid out and written.
"""

import json
from base64 import b64encode
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from uq.files.output_folder import place
from uq.report.certificate_front import number_of
from uq.report.page_parts import Page, input_table
from uq.report.pages import joined, page

DPI = 300
"""Resolution of PNG figures, and of what SVG figures hold as pixels [1/in]."""
ELSEWHERE = ("experiment", "resolved", "report", "inputs", "experiment_file", "centre", "others")
"""Parts of the provenance that stand in other places of a page."""


def report(result: Any) -> str:
    """Return a result's report: an HTML page with its style and figures inside, which loads nothing from elsewhere.

    Raises:
        TypeError: there is no report for this kind of result.
    """
    content = page(result)
    svg = {drawing.name: drawing.moving or _render(drawing.figure, "svg") for drawing in content.figures}
    return _html(content, svg, number(content, result.to_dict()))


def write(result: Any, out: Path, *more: Any) -> None:
    """Write ``result.json`` (``centre.json`` of a centre), ``report.html`` and the figures (SVG and PNG) into a folder.

    What ``more`` results say, such as a budget, joins the same report and JSON; a CSV and other files that a result
    brings stand beside them.

    Everything is made before the first file is moved into place, so that a failure leaves no half-written file. A file
    of the same name is replaced; other files stay.

    Raises:
        OSError: the folder cannot be made or written.
        TypeError: there is no report for this kind of result.
    """
    place(files(result, *more), out)


def files(result: Any, *more: Any) -> dict[str, bytes]:
    """Return the content of a result's files by name, together with that of ``more``."""
    content = joined(page(result), *map(page, more))
    svg = {drawing.name: drawing.moving or _render(drawing.figure, "svg") for drawing in content.figures}
    figures = result.to_dict() | {other.name: other.to_dict() for other in more}
    name = number(content, figures)
    return {
        getattr(result, "file_name", "result.json"): _json(figures | ({"certificate": name} if name else {})).encode(),
        "report.html": _html(content, svg, name).encode(),
        **{f"{one.name}.csv": one.csv().encode() for one in (result, *more) if hasattr(one, "csv")},
        **{name: data for one in (result, *more) if hasattr(one, "files") for name, data in one.files().items()},
        **{f"{name}.svg": data for name, data in svg.items()},
        **{f"{drawing.name}.png": _render(drawing.figure, "png") for drawing in content.figures},
    }


def number(content: Page, figures: Mapping[str, Any]) -> str:
    """Return the number of a certificate: as stated, or made of its content; empty for any other report."""
    return "" if content.front is None else content.front.number or number_of(figures)


def _html(content: Page, svg: Mapping[str, bytes], name: str) -> str:
    environment = Environment(
        loader=PackageLoader("uq"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["css_text"] = _css_text
    images = {key: f"data:image/svg+xml;base64,{b64encode(data).decode()}" for key, data in svg.items()}
    record = {key: _words(value) for key, value in content.provenance.items() if key not in ELSEWHERE}
    experiment = _json(content.provenance.get("experiment") or content.provenance.get("resolved") or {})
    template = environment.get_template("certificate.html" if content.front else "report.html")
    return template.render(
        page=content, images=images, provenance=record, experiment=experiment, inputs=input_table(content.provenance),
        number=name, footer=name or content.title,
    )  # fmt: skip


def _css_text(text: str) -> Markup:
    """A string of CSS in which nothing can end it."""
    return Markup('"' + "".join(c if c.isalnum() and c.isascii() else f"\\{ord(c):06x}" for c in text) + '"')  # noqa: S704


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {item}" for name, item in value.items())
    return "–" if value is None else str(value)


def _render(figure: Figure, kind: str) -> bytes:
    """Return a figure's file; the same figure gives the same bytes. Its parts then stay where they are."""
    buffer = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "inertia-uq"}):
        figure.savefig(buffer, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else None)
    figure.set_layout_engine("none")  # laying it out takes longer than drawing it
    return buffer.getvalue()


def _json(content: object) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

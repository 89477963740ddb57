"""Reports: one HTML page that stands alone, and a result's files in a folder.

What a page says of which result is in :mod:`uq.pages`; here it is laid out and written.
"""

import json
import os
import tempfile
from base64 import b64encode
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from uq.pages import Page, joined, page

DPI = 300
"""Resolution of PNG figures, and of what SVG figures hold as pixels [1/in]."""


def report(result: Any) -> str:
    """Return a result's report: an HTML page with its style and figures inside, which loads nothing from elsewhere.

    Raises:
        TypeError: there is no report for this kind of result.
    """
    content = page(result)
    return _html(content, {drawing.name: _render(drawing.figure, "svg") for drawing in content.figures})


def write(result: Any, out: Path, *more: Any) -> None:
    """Write ``result.json`` (``centre.json`` of a centre), ``report.html`` and the figures (SVG and PNG) into a folder.

    What ``more`` results say, such as a budget, joins the same report and JSON; a CSV and other files of theirs stand
    beside them.

    Everything is made before the first file is moved into place, so that a failure leaves no half-written file. A file
    of the same name is replaced; other files stay.

    Raises:
        OSError: the folder cannot be made or written.
        TypeError: there is no report for this kind of result.
    """
    place(files(result, *more), out)


def place(content: Mapping[str, bytes], out: Path) -> None:
    """Write files into a folder: all are on the disk before the first is moved into place.

    Raises:
        OSError: the folder cannot be made or written.
    """
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".partial-", dir=out) as folder:
        for name, data in content.items():
            _write(Path(folder, name), data)
        for name in content:
            os.replace(Path(folder, name), out / name)


def files(result: Any, *more: Any) -> dict[str, bytes]:
    """Return the content of a result's files by name, together with that of ``more``."""
    content = joined(page(result), *map(page, more))
    svg = {drawing.name: _render(drawing.figure, "svg") for drawing in content.figures}
    return {
        getattr(result, "file_name", "result.json"): _json(
            result.to_dict() | {other.name: other.to_dict() for other in more}
        ).encode(),
        "report.html": _html(content, svg).encode(),
        **{f"{one.name}.csv": one.csv().encode() for one in (result, *more) if hasattr(one, "csv")},
        **{name: data for one in more if hasattr(one, "files") for name, data in one.files().items()},
        **{f"{name}.svg": data for name, data in svg.items()},
        **{f"{drawing.name}.png": _render(drawing.figure, "png") for drawing in content.figures},
    }


def _html(content: Page, svg: Mapping[str, bytes]) -> str:
    environment = Environment(
        loader=PackageLoader("uq"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    images = {name: f"data:image/svg+xml;base64,{b64encode(data).decode()}" for name, data in svg.items()}
    record = {k: _words(v) for k, v in content.provenance.items() if k not in ("experiment", "resolved")}
    experiment = _json(content.provenance.get("experiment") or content.provenance.get("resolved") or {})
    return environment.get_template("report.html").render(
        page=content, images=images, provenance=record, experiment=experiment
    )


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {item}" for name, item in value.items())
    return "–" if value is None else str(value)


def _render(figure: Figure, kind: str) -> bytes:
    """Return a figure's file; the same figure gives the same bytes."""
    buffer = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "inertia-uq"}):
        figure.savefig(buffer, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else None)
    return buffer.getvalue()


def _write(path: Path, data: bytes) -> None:
    """Write a file down to the disk, so that a full one is noticed here."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _json(content: object) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

"""A report's page: sections of results laid out as one HTML file that loads nothing from elsewhere.

Its figures are SVG whose texts are the page's and whose colours follow the reader's scheme. A figure's file stays as
matplotlib draws it; the page holds a smaller form, in which a name is found and copied.
"""

import json
import re
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from xml.etree import ElementTree
from zlib import Z_RLE

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from identify.display.reporting import Drawing, Section, plain
from identify.display.text_tables import Table
from rig.exceptions import on_its_lines
from uq.report.certificate.front import number_of
from uq.report.figures.style import COLUMN, DARK
from uq.report.input_tables import input_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 240
"""Resolution of PNG figures, and of what SVG figures hold as pixels [1/in]."""
VERDICTS = ("Nothing calls for attention.", "Read what calls for attention before you use the figures.")
"""Verdicts for a result that states none: without findings, and with findings."""
NARROW = 44
"""Characters of a table's row that a phone shows."""
ELSEWHERE = ("tare", "experiment", "resolved", "report", "inputs", "experiment_file", "centre", "others")
"""Parts of the provenance that stand in other places of a page."""


class Drawn(NamedTuple):
    """A figure, and how a page shows it."""

    name: str
    caption: str
    figure: "Figure"
    svg: bytes
    """The figure's file: the SVG that moves, where there is one."""
    pictures: Sequence[Markup]
    """The elements of a page: the figure, and the same in motion."""

    @property
    def wide(self) -> bool:
        """Whether the figure takes the width of a page rather than of a column."""
        return bool(self.figure.get_figwidth() > COLUMN)


def drawn(drawings: Sequence[Drawing]) -> list[Drawn]:
    """Draw the figures of a page."""
    return [_drawn(drawing, 2 * k) for k, drawing in enumerate(drawings)]


def _drawn(drawing: Drawing, number: int) -> Drawn:
    figure = laid_out(cast("Figure", drawing.draw()))
    forms = [rendered(figure, "svg"), *([] if drawing.animate is None else [drawing.animate()])]
    pictures = [inline(svg, number + k, drawing.caption) for k, svg in enumerate(forms)]
    return Drawn(name=drawing.name, caption=drawing.caption, figure=figure, svg=forms[-1], pictures=pictures)


def joined(first: Section, *others: Section) -> Section:
    """Return one section with the content of several; title and front stand as the first has them."""
    sections = (first, *others)
    parts: dict[str, Any] = {}
    for name in ("computed", "findings", "not_stated", "tables", "drawings", "details", "adjustable", "assumptions"):
        items = [item for section in sections for item in getattr(section, name)]
        parts[name] = [item for k, item in enumerate(items) if item not in items[:k]]
    names = [drawing.name for drawing in parts["drawings"]]
    parts["drawings"] = [drawing for k, drawing in enumerate(parts["drawings"]) if names[k] not in names[:k]]
    if first.verdict and parts["findings"] and not first.findings:
        parts["verdict"] = f"{VERDICTS[True]} {first.verdict}"
    if others:
        parts["provenance"] = {**first.provenance, "others": [section.provenance for section in others]}
    return replace(first, **parts)


def number(section: Section, content: Mapping[str, Any]) -> str:
    """Return the number of a certificate: as stated, or made of its content; empty for any other report."""
    return "" if section.front is None else section.front.number or number_of(content)


def html(section: Section, figures: list[Drawn], name: str) -> str:
    """Return the page.

    Args:
        section: what it says.
        figures: its figures, drawn.
        name: number of a certificate; empty: it is none.
    """
    environment = Environment(
        loader=PackageLoader("uq"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(css_text=_css_text, scrolls=_scrolls)
    record = {key: _words(value) for key, value in section.provenance.items() if key not in ELSEWHERE}
    experiment = json_text(section.provenance.get("experiment") or section.provenance.get("resolved") or {})
    pictures, styles = styled([picture for figure in figures for picture in figure.pictures])
    remaining = iter(pictures)
    figures = [figure._replace(pictures=[next(remaining) for _ in figure.pictures]) for figure in figures]
    template = environment.get_template("certificate.html" if section.front else "report.html")
    script, numbers = _script(environment) if section.adjustable else "", map(_numbers, section.adjustable)
    page = template.render(
        page=section, figures=figures, provenance=record, experiment=experiment, adjustable=list(numbers),
        inputs=input_table(section.provenance), number=name, footer=name or section.title, script=script,
        script_hash=_hash(script), colours=colours(), styles=styles,
        verdict=section.verdict or VERDICTS[bool(section.findings)],
    )  # fmt: skip
    return on_its_lines(page)


def _script(environment: Environment) -> Markup:
    """The script of tables whose figures can be changed; the page allows itself no other."""
    begin = "for (const place of document.querySelectorAll('.adjustable'))"
    redraw = "adjustable(place, JSON.parse(place.previousElementSibling.textContent));"
    return Markup(f"{environment.get_template('adjustable.js').render()}\n{begin} {redraw}\n")  # noqa: S704 - ours


def _hash(script: str) -> str:
    """A script as a Content-Security-Policy names it."""
    return f"sha256-{b64encode(sha256(script.encode()).digest()).decode()}"


def _numbers(content: Mapping[str, Any]) -> Markup:
    """JSON inside a page, in which nothing can end the element that holds it."""
    return Markup(json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"))  # noqa: S704


def laid_out(figure: "Figure") -> "Figure":
    """Return a figure whose parts are in their places and stay there, as its files need it."""
    import matplotlib
    from matplotlib.text import Text

    for text in figure.findobj(Text):  # a name, as of a run, may hold what no SVG may
        if (shown := on_its_lines(text.get_text())) != text.get_text():
            text.set_text(shown)
    if engine := figure.get_layout_engine():
        engine.execute(figure)
    with matplotlib.rc_context({"figure.autolayout": False, "figure.constrained_layout.use": False}):
        figure.set_layout_engine(None)  # with any engine, also "none", each file is drawn twice, the first time for it
    return figure


def rendered(figure: "Figure", kind: str) -> bytes:
    """Return a figure's file; the same figure gives the same bytes.

    Args:
        figure: laid out.
        kind: ``svg``, whose texts are texts, or ``png``.
    """
    import matplotlib

    buffer = BytesIO()
    options: Any = {"pil_kwargs": {"compress_type": Z_RLE}} if kind == "png" else {"metadata": {"Date": None}}
    with matplotlib.rc_context({"svg.hashsalt": "inertia-uq", "svg.fonttype": "none"}):
        figure.savefig(buffer, format=kind, dpi=DPI, **options)
    return buffer.getvalue()


def json_text(content: object) -> str:
    """Return content as JSON for people to read; a number that is not finite is null."""
    return on_its_lines(json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def _css_text(text: str) -> Markup:
    """A string of CSS in which nothing can end it."""
    return Markup('"' + "".join(c if c.isalnum() and c.isascii() else f"\\{ord(c):06x}" for c in text) + '"')  # noqa: S704


def _scrolls(table: Table) -> bool:
    """Whether a table is wider than a phone, so that a keyboard must reach it to move it."""
    lines = [table.head, *table.rows]
    longest = [max(len(line[k]) for line in lines) for k in range(len(table.head))]
    return len(longest) > 3 if table.wrap else sum(longest) + 2 * len(longest) > NARROW


def _words(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_words(item)}" for name, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return "–" if value is None else str(value)


ROUNDED = ("d", "x", "y", "width", "height", "points", "transform")
"""Attributes whose figures need two decimals of a point at most, from ten on a single one: a fifteenth of a pixel."""
REFERENCE = re.compile(r"url\(#([^)]+)\)")
FONT = re.compile(r"(?:font-family|stroke-miterlimit):[^;]*;? *")


def inline(svg: bytes, number: int, description: str) -> Markup:
    """Return an SVG as an element of a page.

    Args:
        svg: the drawing.
        number: of the figure in its page, which makes its names unique there.
        description: what a reader who does not see it is told.
    """
    root = ElementTree.fromstring(svg)  # noqa: S314 - ours
    width, height = (float(re.match(r"[\d.]+", root.get(side, "0"))[0]) for side in ("width", "height"))  # type: ignore[index]
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        element.attrib = {name.rpartition("}")[2]: value for name, value in element.attrib.items()}
        element.text, element.tail = (text if text and text.strip() else None for text in (element.text, element.tail))
    for name in ("metadata", "style"):
        for parent in root.iter():
            for child in [child for child in parent if child.tag == name]:
                parent.remove(child)
    _attributes(root, f"f{number}-")
    root.attrib = {
        "viewBox": root.get("viewBox", f"0 0 {width:g} {height:g}"),
        "role": "img",
        "aria-label": description,
    }
    return Markup(ElementTree.tostring(root, encoding="unicode").replace(" />", "/>"))  # noqa: S704 - texts are escaped by the library


def styled(figures: Sequence[Markup]) -> tuple[list[Markup], Markup]:
    """Return figures whose styles have names, and what these say, so that a page says each once."""
    names: dict[str, str] = {}

    def named(match: re.Match[str]) -> str:
        return f'class="{names.setdefault(match[1], f"a{len(names)}")}"'

    shorter = [Markup(re.sub(r'style="([^"]*)"', named, figure)) for figure in figures]  # noqa: S704 - ours
    return shorter, Markup("".join(f".{name}{{{style}}}\n" for style, name in names.items()))  # noqa: S704 - ours


def colours() -> Markup:
    """Return the colours of figures by day and night, as declarations of CSS."""
    return Markup("".join(f"--c{light[1:]}: light-dark({light}, {dark}); " for light, dark in DARK.items()))  # noqa: S704


def _attributes(root: ElementTree.Element, prefix: str) -> None:
    """Colours become the page's, names unique, figures short; names to which nothing refers go."""
    everything = list(root.iter())
    wanted = [name for element in everything for value in element.attrib.values() for name in REFERENCE.findall(value)]
    wanted += [element.get("href", "")[1:] for element in everything if element.get("href", "").startswith("#")]
    names = {name: f"{prefix}{k}" for k, name in enumerate(dict.fromkeys(wanted))}
    for element in everything:
        attributes = {
            name: value for name, value in element.attrib.items()
            if (name != "id" or value in names) and not value.startswith("rotate(-0 ")
        }  # fmt: skip
        for name, value in attributes.items():
            if name == "id":
                value = names[value]
            elif name == "href":
                value = f"#{names[value[1:]]}" if value.startswith("#") else _smaller(value)
            elif name in ROUNDED:
                value = _short(value)
            elif name in ("style", "fill", "stroke"):
                value = _in_page_colours(FONT.sub("", value))
            attributes[name] = REFERENCE.sub(lambda match: f"url(#{names[match[1]]})", value)
        element.attrib = attributes
    styles = {f"#{element.get('id')}": element.get("style") for element in everything if element.get("id")}
    for element in everything:
        if element.tag == "use" and element.get("style") == styles.get(element.get("href", "")):
            element.attrib.pop("style", None)  # what it draws says it


def _short(value: str) -> str:
    """Figures with the decimals that are seen, and no more room between them than they need."""
    if "matrix" not in value and "scale" not in value:
        value = re.sub(r"-?\d+\.\d+", lambda match: _rounded(float(match[0])), value)
    return re.sub(r"\s*([MLCQZzl])\s*", r"\1", value).strip()


def _rounded(figure: float) -> str:
    return f"{figure:.{2 if abs(figure) < 10 else 1}f}".rstrip("0").rstrip(".")


def _in_page_colours(style: str) -> str:
    return re.sub(
        r"#[0-9a-f]{6}\b", lambda match: f"var(--c{match[0][1:]})" if match[0] in DARK else match[0], style.lower()
    )


def _smaller(address: str) -> str:
    """A picture of pixels at half its resolution, with 128 colours."""
    head, _, data = address.partition(",")
    picture = Image.open(BytesIO(b64decode(data))).convert("RGBA").reduce(2)
    buffer = BytesIO()
    picture.quantize(128, method=Image.Quantize.FASTOCTREE).save(buffer, format="png", optimize=True)
    return f"{head},{b64encode(buffer.getvalue()).decode()}"

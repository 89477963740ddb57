"""A figure as part of a page: SVG whose texts are the page's and whose colours follow the reader's scheme.

The figure's file stays as matplotlib draws it; the page holds a smaller form, in which a name is found and copied.
"""

import re
from base64 import b64decode, b64encode
from collections.abc import Sequence
from io import BytesIO
from xml.etree import ElementTree

from markupsafe import Markup
from PIL import Image

from uq.report.figures.style import DARK

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

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
MARK = "mark"
"""Tag of a mark that has become a line, until it is joined with others."""
BETWEEN = (MARK, "use", "text", "defs")
"""Elements between the lines of a grid."""
STRAIGHT = re.compile(r"\s*M (\S+) (\S+)\s+L (\S+) (\S+)\s*")
"""A line from a point to another, as matplotlib writes it."""
SMALL = re.compile(r"(M-?[\d.]+ -?[\d.]+(?:[HV]-?[\d.]+|L-?[\d.]+ -?[\d.]+){1,3}z?)+")
"""A line or a bar, or several."""
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
    _straightened(root)
    _attributes(root, f"f{number}-")
    _unwrapped(root)
    _clipped_together(root)
    _joined(root)
    for mark in root.iter(MARK):
        mark.tag = "path"
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


def _straightened(root: ElementTree.Element) -> None:
    """Marks that are a straight line, as ticks and caps, become lines in their places, which can be joined."""
    lines = {f"#{e.get('id')}": (e, line) for e in root.iter("path") if (line := STRAIGHT.fullmatch(e.get("d", "")))}
    for element in list(root.iter("use")):
        mark, line = lines.get(element.get("href", ""), (None, None))
        if mark is None or line is None or "transform" in element.attrib:
            continue
        x, y = (float(element.get(name, "0")) for name in "xy")
        x0, y0, x1, y1 = map(float, line.groups())
        attributes = {name: value for name, value in element.attrib.items() if name not in ("href", "x", "y")}
        style = {"style": f"{attributes.get('style', '')};{mark.get('style', '')}".strip(";")}
        element.tag, element.attrib = MARK, {**attributes, **style, "d": f"M{x + x0} {y + y0}L{x + x1} {y + y1}"}
    for parent in list(root.iter("defs")):
        parent[:] = [mark for mark in parent if f"#{mark.get('id')}" not in lines]


def _unwrapped(parent: ElementTree.Element) -> None:
    """Groups that say nothing give way to what they hold, and such as clip paths alone to paths that say it."""
    children: list[ElementTree.Element] = []
    for child in parent:
        _unwrapped(child)
        paths = all(
            inner.tag in (MARK, "path") and not {"clip-path", "transform"} & set(inner.attrib) for inner in child
        )
        if child.tag != "g" or (child.attrib and not (paths and set(child.attrib) == {"clip-path"})):
            children.append(child)
            continue
        for inner in child:
            inner.attrib |= child.attrib
        children += child
    parent[:] = children


def _clipped_together(parent: ElementTree.Element) -> None:
    """Paths that are clipped alike become a group, which says it once: those in a row, or with marks between them.

    Marks and labels of ticks stand between the lines of a grid, which they do not meet.
    """
    children: list[ElementTree.Element] = []
    group: ElementTree.Element | None = None
    for child in parent:
        clip = child.get("clip-path") if child.tag in (MARK, "path") and "transform" not in child.attrib else None
        if clip is None:
            _clipped_together(child)
            children.append(child)
            group = group if child.tag in BETWEEN else None
            continue
        if group is None or group.get("clip-path") != clip:
            group = ElementTree.Element("g", {"clip-path": clip})
            children.append(group)
        del child.attrib["clip-path"]
        group.append(child)
    parent[:] = children


def _joined(parent: ElementTree.Element) -> None:
    """Small opaque paths in a row that differ in their place alone become a single one; empty definitions go.

    Marks of an axis are in a row although their labels stand between them.
    """
    children: list[ElementTree.Element] = []
    for child in parent:
        _joined(child)
        row = [sibling for sibling in children if child.tag != MARK or sibling.tag != "text"]
        before = row[-1] if row else None
        if before is not None and _look(child) == _look(before) is not None:
            before.set("d", before.get("d", "") + child.get("d", ""))
        elif child.tag != "defs" or len(child):
            children.append(child)
    parent[:] = children


def _look(element: ElementTree.Element) -> dict[str, str] | None:
    """Return the style of a path that may be joined: a line or a bar, of which none shows through another."""
    look = {"tag": element.tag, **{name: value for name, value in element.attrib.items() if name != "d"}}
    simple = element.tag in (MARK, "path") and not len(element) and not {"id", "transform"} & set(look)
    opaque = "opacity" not in "".join(look) + "".join(look.values())
    return look if simple and opaque and SMALL.fullmatch(element.get("d", "")) else None


def _short(value: str) -> str:
    """Figures with the decimals that are seen, and no more room between them than they need."""
    if "matrix" not in value and "scale" not in value:
        value = re.sub(r"-?\d+\.\d+", lambda match: _rounded(float(match[0])), value)
    return _along_axes(re.sub(r"\s*([MLCQZzl])\s*", r"\1", value).strip())


def _rounded(figure: float) -> str:
    return f"{figure:.{2 if abs(figure) < 10 else 1}f}".rstrip("0").rstrip(".")


def _along_axes(path: str) -> str:
    """Lines along the axes with one coordinate; other paths, and other attributes, as they are."""
    if not re.fullmatch(r"(?:[ML]-?[\d.]+ -?[\d.]+|z)+", path):
        return path
    short, last = "", ("", "")
    for letter, x, y in re.findall(r"([MLz])(?:(-?[\d.]+) (-?[\d.]+))?", path):
        if letter == "L" and y == last[1]:
            short += f"H{x}"
        elif letter == "L" and x == last[0]:
            short += f"V{y}"
        else:
            short += letter if letter == "z" else f"{letter}{x} {y}"
        last = last if letter == "z" else (x, y)
    return short


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

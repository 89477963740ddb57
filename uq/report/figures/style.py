"""Sizes, colours and names of figures, as wide as a journal's column or page (3.5 and 7.2 in).

In Okabe and Ito's colours, which colour-blind readers tell apart. Matplotlib is imported when a figure is drawn.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from identify.display.reporting import PLACE

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

COLUMN, PAGE = 3.5, 7.2
"""Width of a column and of a page [in]."""

PALETTE = ("#404040", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#A0A0A0")
AXIS_COLOURS = PALETTE[1:4]
"""Colours of the three axes."""
DARK_COLOURS = PALETTE[0], PALETTE[1], PALETTE[3], PALETTE[6]
"""Colours on which text is white; on all others it is black."""
MOST = 6
"""Parts that have a colour of their own."""
LINES = 12
"""Most sources that have a line each."""
SEEN = 0.3
"""Share from which a bar's part is seen, and stands in the legend [%]: two hundredths of an inch."""
OTHERS = PALETTE[7]
"""Colour of all other parts together."""
GRID, RULE, FILL = "#e4e4e4", "#808080", "#d4d4d4"
"""Greys of grid lines, of zero lines and rims, and of areas that fill the rest."""
DARK = {
    "#ffffff": "#161616", "#000000": "#e4e4e4", "#404040": "#d0d0d0", "#0072b2": "#4aa3df", "#e69f00": "#f0b429",
    "#009e73": "#22b98c", "#cc79a7": "#e09ac2", "#56b4e9": "#8accf2", "#d55e00": "#f2854a", "#a0a0a0": "#8f8f8f",
    GRID: "#363636", RULE: "#8f8f8f", FILL: "#5a5a5a", "#ececec": "#2c2c2c",
}  # fmt: skip
"""Colour that replaces each colour of a page when its reader asks for a dark scheme."""
STYLE: dict[Any, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 1.0,
    "lines.linewidth": 0.8,
    "hatch.linewidth": 0.6,
    "figure.dpi": 150,
}
"""Settings of matplotlib while :func:`uq.report.drawing.drawing` draws: no figure touches the global ones."""
NAMES = {"total": "total", "cg": "CG", "imu": "IMU", "r_cg": "r CG"}


def largest(names: Sequence[str], sizes: Sequence[float]) -> tuple[list[int], list[int]]:
    """Return the places of the parts that have a colour of their own, the largest first, and of those that share one.

    Args:
        names: of the parts.
        sizes: of the parts, in any unit.
    """
    order = sorted(range(len(names)), key=lambda k: -sizes[k])
    return (order, []) if len(order) <= MOST + 1 else (order[:MOST], order[MOST:])


def coloured_parts(names: Sequence[str], shares_of: Any) -> list[tuple[str, str, Any]]:
    """Return name, colour and shares of the largest parts, and of all others together.

    Args:
        names: of the parts.
        shares_of: array of their shares in each column, (parts, columns).
    """
    shown, rest = largest(names, shares_of.max(axis=1).tolist())
    parts = [(label(display_name(names[k])), PALETTE[1 + n], shares_of[k]) for n, k in enumerate(shown)]
    return [*parts, *([(f"{len(rest)} others", OTHERS, shares_of[rest].sum(axis=0))] if rest else [])]


def legend_above(figure: Any) -> None:
    """Put a legend of all panels above them, each name once, in as many columns as fit."""
    names, handles, count = _entries(figure.axes, width_of(figure))
    figure.legend(handles, names, loc="outside upper center", ncols=count)


def legend_over(axes: Any, width: float) -> None:
    """Put a legend of a panel of this width [in] above it."""
    names, handles, count = _entries([axes], width)
    axes.legend(handles, names, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=count)


def _entries(panels: Sequence[Any], width: float) -> tuple[list[str], list[Any], int]:
    """Names and handles of a legend, each name once, read row by row; and how many columns it has."""
    entries: dict[str, Any] = {}
    for axes in panels:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(name, handle)
    count = columns(list(entries), width)
    names = [name for column in range(count) for name in list(entries)[column::count]]  # matplotlib fills columns
    return names, [entries[name] for name in names], count


def columns(names: Sequence[str], width: float) -> int:
    """Return how many columns of a legend fit a width [in]: a letter takes 0.07 in, what stands before a name 0.45."""
    widths = [0.45 + 0.07 * len(name) for name in names]
    return max(1, len(names) if sum(widths) <= width else int(width / max(widths)))


def stacked(axes: Any, parts: Sequence[tuple[str, str, Any]], thickness: float) -> None:
    """Draw bars from left to right, one on the end of another: name, colour and lengths [%] of each part."""
    base = 0.0
    for name, colour, lengths in parts:
        seen = name if max(lengths) >= SEEN else "_"  # without an entry in the legend
        axes.barh(
            range(len(lengths)), lengths, thickness, left=base, color=colour, edgecolor="white", linewidth=0.3,
            label=seen,
        )  # fmt: skip
        base = base + lengths


def on(colour: str) -> str:
    """Return the colour in which a text on this colour is read."""
    return "white" if colour in DARK_COLOURS else "#1a1a1a"


def new_figure(width: float, height: float, **options: Any) -> "FigureBase":
    """Return an empty figure of this size [in], or what ``drawn_in`` of a result names in its place."""
    from matplotlib.figure import Figure

    place = PLACE.get()
    return Figure(figsize=(width, height), **options) if place is None else place


def width_of(figure: Any) -> float:
    """Return the width of a figure, or of a part of one [in]."""
    return float(figure.bbox.width / figure.dpi)


def display_name(name: str) -> str:
    """Return a group's or source's name as a reader would write it."""
    return NAMES.get(name, name.replace("_", " ").replace("omega", "ω"))


def label(name: str) -> str:
    """Return a name that matplotlib does not take for a formula."""
    return name.replace("$", r"\$")

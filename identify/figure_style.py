"""How figures look: sizes, colours, names. Drawn at the width of a journal's column or page (3.5 and 7.2 in).

In Okabe and Ito's colours, which colour-blind readers tell apart. Nothing here needs matplotlib.
"""

from typing import Any

COLUMN, PAGE = 3.5, 7.2
"""Width of a column and of a page [in]."""

PALETTE = ("#404040", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#A0A0A0")
AXIS_COLOURS = PALETTE[1:4]
"""Of the three axes."""
HATCHES = ("", "////", "....")
GRID, RULE, FILL = "#e4e4e4", "#808080", "#d4d4d4"
"""Of lines behind the data, of a zero or a rim, and of what fills the rest."""
DARK = {
    "#ffffff": "#161616", "#000000": "#e4e4e4", "#404040": "#d0d0d0", "#0072b2": "#4aa3df", "#e69f00": "#f0b429",
    "#009e73": "#22b98c", "#cc79a7": "#e09ac2", "#56b4e9": "#8accf2", "#d55e00": "#f2854a", "#a0a0a0": "#8f8f8f",
    GRID: "#363636", RULE: "#8f8f8f", FILL: "#5a5a5a", "#ececec": "#2c2c2c",
}  # fmt: skip
"""What a page shows in place of each colour when its reader asks for a dark scheme."""
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
"""Settings of matplotlib, for ``matplotlib.rc_context``: no figure touches the global ones."""
NAMES = {"total": "total", "cg": "CG", "imu": "IMU", "r_cg": "r CG"}


def display_name(name: str) -> str:
    """Return a group's or source's name as a reader would write it."""
    return NAMES.get(name, name.replace("_", " ").replace("omega", "ω"))


def label(name: str) -> str:
    """Return a name that matplotlib does not take for a formula."""
    return name.replace("$", r"\$")

"""Datasheet figures in words: ``"±0.5 % of full scale, k = 2"`` to the distribution that it states.

What the words mean is the GUM's reading of such statements: a coverage factor or a level of confidence says normal
(4.3.3, 4.3.4; Student's t with stated degrees of freedom), bare limits say rectangular (4.3.7), a resolution is
rectangular with the half-width of half a step (F.2.2.1).
"""

import re
from statistics import NormalDist
from typing import Any

import scipy

from rig.exceptions import quoted
from uq.files.units import UnitError, quantity
from uq.sources.distributions import Distribution, Normal, Rectangular, StudentT, Triangular, UShaped

NUMBER = r"\d+(?:\.\d*)?(?:[eE][+-]?\d+)?"
SHAPES = {
    "rectangular": Rectangular, "uniform": Rectangular, "triangular": Triangular, "u-shaped": UShaped,
    "arcsine": UShaped, "arc sine": UShaped,
}  # fmt: skip
WORDS = re.compile(
    r"(?:(?:expanded uncertainty|accuracy|uncertainty|error|within|maximum|max\.|max|up to|less than"
    r"|U =|U=|±|\+/-|\+-|<=|≤|<)[ :=]*)*", re.I
)  # fmt: skip
"""Words that may stand before a figure without changing its meaning."""
FULL_SCALE = re.compile(rf"({NUMBER})\s*%\s*(?:of\s+)?(?:the\s+)?(?:full[ -]scale|F\.?S\.?O?\.?|range|span)", re.I)
REMARKS = {
    "k": rf"k\s*=\s*({NUMBER})|(\d)\s*(?:σ|sigma)|rms|standard (?:uncertainty|deviation)",
    "level": rf"({NUMBER})\s*%(?:\s+(?:confidence|coverage|level).*)?",
    "freedom": rf"({NUMBER})\s+degrees of freedom|(?:ν|nu|dof)\s*=\s*({NUMBER})",
    "resolution": "resolution",
    "normal": "normal|gaussian",
}
"""Remarks beside a figure, apart from the names of shapes."""
READING = re.compile(rf"({NUMBER})\s*%\s*(?:of\s+)?(?:the\s+)?(?:reading|measured value|value|RD)", re.I)
EXAMPLES = "'0.1 % FS, k = 2', 'accuracy ±2 N', '±2 N, 95 %'"


def datasheet(
    text: object, unit: str, *, full_scale: float | None = None, reading: float | None = None
) -> Distribution:
    """Return the distribution of an error, about zero, that a datasheet states.

    Args:
        text: the statement: an error in ``unit``, in per cent of full scale or of reading; after a comma or in brackets
            a coverage factor (``k = 2``, ``3 sigma``, ``rms``), a level of confidence (``95 %``), degrees of freedom,
            or a shape (``rectangular``, ``triangular``, ``u-shaped``).
        unit: unit of the result.
        full_scale: full scale in ``unit``, for figures in per cent of it.
        reading: what is measured, in ``unit``, for figures in per cent of it.

    Raises:
        UnitError: the statement is not understood, or needs the full scale or the reading.
    """
    if not isinstance(text, str):
        raise UnitError(f"is {quoted(text)}: write a statement such as {EXAMPLES}")
    figure, remarks = _parts(text)
    return _meaning(text, _half_width(text, figure, unit, full_scale, reading), remarks)


def stated_figure(text: str) -> tuple[float, str]:
    """Return the number of a statement that :func:`datasheet` takes, and the words behind it.

    Example: ``stated_figure("accuracy ±0.5 % FS, k = 2")`` is ``(0.5, "% FS, k = 2")``.
    """
    figure, remarks = _parts(text)
    number = re.match(NUMBER, figure)
    return float(number[0]), ", ".join([figure[number.end() :].strip(), *remarks])  # type: ignore[index, union-attr]


def _parts(text: str) -> tuple[str, list[str]]:
    """The figure of a statement without the words before it, and the remarks beside it."""
    figure, *remarks = (part.strip() for part in re.split(r"[,;()]", text) if part.strip() or not text.strip())
    for words in (r"\d\s*(?:σ|sigma)", "rms", "resolution", "standard (?:uncertainty|deviation)"):
        if remark := re.search(rf"(?<!\w){words}(?!\w)", figure, re.I):  # also beside the figure
            remarks.append(remark[0])
            figure = (figure[: remark.start()] + figure[remark.end() :]).strip(" =:")
    return WORDS.sub("", figure, count=1), remarks


def _half_width(text: str, figure: str, unit: str, full_scale: float | None, reading: float | None) -> float:
    for pattern, name, base in ((FULL_SCALE, "full scale", full_scale), (READING, "reading", reading)):
        if match := pattern.fullmatch(figure):
            if base is None:
                raise UnitError(f"is {quoted(text)}: give the {name} too")
            return float(match[1]) / 100 * base
    try:
        value = quantity(re.sub(rf"^({NUMBER})\s*(?=\D)", r"\1 ", figure), unit)
    except UnitError:
        raise UnitError(
            f"is {quoted(text)}: write a figure in {unit} or in % of full scale, such as '±0.5 % of full scale, k = 2'"
        ) from None
    if not value >= 0:
        raise UnitError(f"is {quoted(text)}: write zero or more")
    return value


def _meaning(text: str, half_width: float, remarks: list[str]) -> Distribution:
    """The distribution of which ``half_width`` is the stated figure."""
    stated = {name: value for words in remarks for name, value in _understood(text, words).items()}
    covers, shape = stated.keys() & {"k", "level"}, stated.get("shape")
    if "resolution" in stated:
        half_width, shape = half_width / 2, shape or Rectangular
    if covers and shape is None:
        return _covering(text, half_width, stated.get("k"), stated.get("level"), stated.get("freedom"))
    if covers or "freedom" in stated:
        raise UnitError(f"is {quoted(text)}: a coverage factor goes with a normal error; leave one out")
    if "normal" in stated:
        raise UnitError(
            f"is {quoted(text)}: a normal error needs a coverage factor or a level of confidence; add k = 2 or 95 %"
        )
    return (shape or Rectangular)(-half_width, half_width)


def _understood(text: str, words: str) -> dict[str, Any]:
    """Return the meaning of one remark beside the figure."""
    for name, pattern in REMARKS.items():
        if match := re.fullmatch(pattern, words, re.I):
            return {name: float(next(filter(None, match.groups()), 1.0))}
    if words.lower() in SHAPES:
        return {"shape": SHAPES[words.lower()]}
    raise UnitError(f"is {quoted(text)}: '{words}' is not understood; write such as {EXAMPLES}")


def _covering(
    text: str, half_width: float, k: float | None, level: float | None, freedom: float | None
) -> Distribution:
    """Normal, or t, of which an expanded uncertainty is stated: by its coverage factor, or by its level alone."""
    if (k is not None and k <= 0) or (level is not None and not 50 <= level < 100) or (freedom or 1) <= 0:
        raise UnitError(f"is {quoted(text)}: write a coverage factor above zero, or a level from 50 % to below 100 %")
    if k is None:
        upper = (1 + (level or 0.0) / 100) / 2
        k = NormalDist().inv_cdf(upper) if freedom is None else float(scipy.special.stdtrit(freedom, upper))
    return Normal(0.0, half_width / k) if freedom is None else StudentT(0.0, half_width / k, freedom)

"""Options that several commands have, and how their texts are read."""

import argparse

from rig.exceptions import quoted
from uq.cli.terminal.command_parser import CommandParser
from uq.files.mistakes import ExperimentError
from uq.files.units import UnitError, quantity


def whole_number(text: str) -> int:
    """Parse a whole number, for argparse."""
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{quoted(text)} is not a whole number") from None
    if abs(number) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text} is out of range")
    return number


def positive_quantity(option: str, text: str, unit: str) -> float:
    """Return a value above zero that an option states with its unit, in ``unit``.

    Raises:
        ExperimentError: it is no such value.
    """
    try:
        value = quantity(text, unit)
    except UnitError as error:
        raise ExperimentError(f"{option} {error}") from None
    if value <= 0:
        raise ExperimentError(f"{option} is {quoted(text)}: give a value above zero")
    return value


MOST_VALUES = 1000
"""Values of a sweep."""


def swept_values(text: str) -> tuple[str, list[str]]:
    """Return key and values of ``--sweep``: ``KEY=A:B:N``, or values with commas between them.

    Raises:
        ExperimentError: it is neither.
    """
    key, _, values = text.partition("=")
    ends = values.split(":")
    if not key or not values or len(ends) not in (1, 3):
        raise ExperimentError(f"--sweep is {quoted(text)}: write KEY=A:B:N, or KEY=A,B,C")
    if len(ends) == 1:
        return key.strip(), [value.strip() for value in values.split(",")]
    (first, _, unit), (last, _, other) = (end.strip().partition(" ") for end in ends[:2])
    try:
        low, high, count = float(first), float(last), int(ends[2])
    except ValueError:
        raise ExperimentError(f"--sweep is {quoted(text)}: write KEY=A:B:N with numbers A, B and N") from None
    if other not in ("", unit) or not 2 <= count <= MOST_VALUES:
        raise ExperimentError(f"--sweep is {quoted(text)}: write both ends in one unit, and 2 to {MOST_VALUES} values")
    step = (high - low) / (count - 1)
    return key.strip(), [f"{low + k * step:.6g} {unit}".strip() for k in range(count)]


class _Limit(argparse.Action):
    """Keeps ``--from`` and ``--to`` in the order in which they were given."""

    def __call__(
        self, parser: object, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        limits = [*getattr(namespace, self.dest), ((option or "").lstrip("-"), values)]
        setattr(namespace, self.dest, limits)


def add_window_options(parser: CommandParser, without: str = "the segments that move are found") -> None:
    """Add ``--from`` and ``--to``, repeatable; :mod:`uq.runs.recorded.time_window` reads ``limits``."""
    for option, what in (("--from", "start"), ("--to", "end")):
        parser.value(
            option, "S", dest="limits", action=_Limit, default=(),
            text=f"{what} of a part of the run that counts: seconds from the run's start, or a mark's name; "
            f"repeatable (without it, {without})",
        )  # fmt: skip


def add_campaign_options(parser: CommandParser, ways: argparse._ActionsContainer | None = None) -> None:
    """Add the options of a campaign; ``ways`` is the group of the ways to draw, where there are others."""
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of every draw (0)")
    (ways or parser).add_argument(
        "--samples", action="store_const", dest="engine", const="samples", default="sums",
        help="draw every sample of every trial: slow, the reference",
    )  # fmt: skip
    parser.add_argument(
        "--dtype", choices=("float64", "float32"), default="float64",
        help="precision of the samples that are drawn (float64)",
    )  # fmt: skip
    parser.value("--out", "DIR", "folder for result.json, report.html and the figures; the run can be resumed")

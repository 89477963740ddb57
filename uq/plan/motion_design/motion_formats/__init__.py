"""Formats of motion files, one file each: what is written, and how it is read back and compared.

An entry point of the group ``inertia_uq.motions`` names a :class:`MotionFormat`.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import entry_points
from typing import Any, NamedTuple

import numpy as np

ENTRIES = entry_points(group="inertia_uq.motions")
EXACT = 2e-9
"""Largest difference of a read value from the motion: rounding to decimals, and to nanoseconds of an instant."""


class MotionFormat(NamedTuple):
    """A motion file that a controller reads."""

    ending: str
    """Ending of the file's name."""
    description: str
    command: type
    """Class in :mod:`uq.plan.motion_design.commanded` of what it holds."""
    write: Callable[[Any], bytes]
    compared: Callable[[bytes, Any], Iterable[tuple[Any, Any]]]
    """Function that reads a file and returns pairs of what it says and what the command is."""
    rate: int = 0
    """Rows a second [Hz]; 0: as the command."""
    tolerance: float = EXACT
    """Largest difference of a read value from the command [m, rad or s]."""
    meaning: Mapping[str, Any] = {}
    """Meaning of a file's numbers, as the JSON beside it states it."""
    suits: Callable[[Any], bool] = lambda _: True
    """Whether a command can be written in it."""


class MotionFile(NamedTuple):
    """A file that was read back and compared with the motion."""

    name: str
    content: bytes
    difference: float
    """Largest difference from the motion [m, rad or s]."""
    format: MotionFormat


def formats(command: type) -> list[MotionFormat]:
    """Return the formats that hold a class of commands, those of the most rows a second first."""
    all_formats = [entry.load() for entry in ENTRIES]
    chosen = [motion_format for motion_format in all_formats if motion_format.command is command]
    return sorted(chosen, key=lambda motion_format: (-motion_format.rate, motion_format.ending))


def written(command: Any, name: str) -> Iterator[MotionFile]:
    """Write a command in each format that suits it, and read it back.

    Raises:
        RuntimeError: a file does not say what it should.
    """
    for motion_format in formats(type(command)):
        if not motion_format.suits(command):
            continue
        motion = command.at_rate(motion_format.rate) if motion_format.rate else command
        file, content = f"{name}.{motion_format.ending}", motion_format.write(motion)
        difference = max(_apart(*pair) for pair in motion_format.compared(content, motion))
        if not difference < motion_format.tolerance:
            raise RuntimeError(f"{file} is {difference:.3g} m or rad from the motion")
        yield MotionFile(file, content, difference, motion_format)


def _apart(read: Any, expected: Any) -> float:
    """Largest difference; infinite where shapes differ."""
    return float(np.abs(read - expected).max()) if np.shape(read) == np.shape(expected) else np.inf

"""Cures of findings as data, and the one function that writes them for terminal, ``result.json`` and documentation.

A cure sets keys of the experiment file: ``Entries({"wrench_frame": "base"})`` is written ``set wrench_frame = "base" in
[recording]``. Where several fit the data, the reader is given each with the words that tell them apart.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

IN_MAP = "[recording] of the map, on top of what it says, and import the table again"
"""Place of the conventions of a run that was imported from a table."""


class Opposite(NamedTuple):
    """A value that reverses what a key declares, of two that it may have."""

    value: str
    otherwise: str
    """The value where the first is declared already."""


@dataclass(frozen=True, eq=False)
class Entries:
    """Keys of a table, each with the value that it is to have.

    Values are texts, numbers, lists, tables, rotation matrices, an :class:`Opposite`, or None for what is unknown.
    """

    values: Mapping[str, object]
    table: str = "recording"
    remark: str = ""
    """Words that follow: when they are right, or what they do."""
    conjunction: str = "or"
    """Word between them and the choice before."""

    @property
    def separate(self) -> list["Entries"]:
        """Each key by itself, the remark behind the last."""
        last = list(self.values)[-1]
        return [replace(self, values={key: x}, remark=self.remark * (key == last)) for key, x in self.values.items()]

    @property
    def line(self) -> str:
        """Keys and values as a TOML file has them, with the remark."""
        text = " and ".join(f"{key} = {value_text(value)}" for key, value in self.values.items())
        return text + self.remark


@dataclass(frozen=True, kw_only=True, eq=False)
class Cure:
    """Settings of the experiment file that cure a finding, each way that fits the data."""

    choices: Sequence[Entries | str]
    """Ways to cure it, by keys or in words: the data may fit several."""
    question: str = ""
    """Question on what may have happened."""
    verb: str = "set"
    lead: str = ""
    """Words before several choices."""
    with_it: Sequence[Entries] = ()
    """Settings that every choice needs besides."""
    then: str = ""
    """Words behind: what else may be done, or what decides between the choices."""
    otherwise: "Cure | None" = None
    """Another cure, of something else that may have happened."""

    @property
    def parts(self) -> list[Entries]:
        """All that is set."""
        return [part for part in (*self.with_it, *self.choices) if isinstance(part, Entries)]

    @property
    def line(self) -> str:
        """The choices, with what each needs besides, without their table."""
        return "".join(f"{part.line} and " for part in self.with_it) + self.lead + self.joined(_line)

    def joined(self, text: Callable[[Entries | str], str]) -> str:
        """Return the choices in one sentence, each as a function writes it."""
        first, *others = self.choices
        words = [f", {other.conjunction if isinstance(other, Entries) else 'or'} {text(other)}" for other in others]
        return text(first) + "".join(words)


def _line(part: Entries | str) -> str:
    return part if isinstance(part, str) else part.line


def written(cure: Cure | str, map_keys: Collection[str] = ()) -> str:
    """Return a cure in words, with the lines that it sets.

    Args:
        cure: keys and values, or words.
        map_keys: keys that are set in the map, where the run was imported from a table.
    """
    if isinstance(cure, str):
        return cure

    def place(part: Entries) -> str:
        return IN_MAP if set(part.values) <= set(map_keys) else f"[{part.table}]"

    def placed(choice: Entries | str) -> str:
        if isinstance(choice, str):
            return choice
        groups = groupby((key for part in (*cure.with_it, choice) for key in part.separate), place)
        return " and ".join(f"{' and '.join(map(_line, group))} in {where}" for where, group in groups)

    places = {place(key) for part in cure.parts for key in part.separate}
    if len(places) == 1:
        text = f"{cure.line}{',' * (len(cure.choices) > 1)} in {places.pop()}"
    else:
        text = cure.lead + cure.joined(placed)
    others = f"; or {written(cure.otherwise, map_keys)}" if cure.otherwise else ""
    return f"{cure.question} {cure.verb} {text}{cure.then}".lstrip() + others


def as_well(others: Sequence[Entries | Cure]) -> str:
    """Return a text on lines that explain the data as well."""
    return "".join(f"; or {other.line}, which fits as well" for other in others)


def value_text(value: object) -> str:
    """Return a value as a TOML file has it; an unknown one is ``?``."""
    match value:
        case None:
            return "?"
        case str():
            return f'"{value}"'
        case Opposite():
            return f'"{value.value}" ("{value.otherwise}" if that is already set)'
        case np.ndarray():
            return axes_text(value)
        case Mapping():
            return f"{{ {', '.join(f'{key} = {value_text(part)}' for key, part in value.items())} }}"
        case Sequence():
            return f"[{', '.join(map(value_text, value))}]"
        case _:
            return f"{value:g}"


def axes_text(matrix: Float[np.ndarray, "n n"]) -> str:
    """Return a signed permutation as ``"-y, z, x"``, any other matrix as rows of numbers with five decimals."""
    if np.allclose(np.abs(matrix).max(axis=1), 1, atol=1e-9):
        columns = np.abs(matrix).argmax(axis=1)
        return '"' + ", ".join(("-" if matrix[i, j] < 0 else "") + "xyzw"[j] for i, j in enumerate(columns)) + '"'
    return "[" + ", ".join("[" + ", ".join(f"{x:.5f}" for x in row) + "]" for row in matrix) + "]"

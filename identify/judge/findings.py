"""All that the judge of a run may name: what the run looks as if, with its size, and the cure.

Causes are errors of the rig, in ``identify/errors``. Any other finding is one file, in ``judge/run_findings`` or
``judge/conventions/findings``, whose docstring is its page and whose classes are its variants.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from typing import ClassVar, dataclass_transform

from identify.display.reporting import place_in_docs
from identify.display.rounding import significant
from identify.judge.cure import Cure, written
from identify.results.declaration import ResidualCause

MATTERS = 0.5
"""Shift of a component over its standard uncertainty from which a finding is worth a warning.

Price: a standard uncertainty 12 % larger, ``hypot(1, 0.5)``.
"""


def signed(value: float) -> str:
    """Return a number of two digits with its sign."""
    return significant(value, 2, signed=True)


@dataclass_transform(kw_only_default=True, frozen_default=True, eq_default=False)
@dataclass(frozen=True, kw_only=True, eq=False)
class Finding(ABC):
    """A finding that is no error with a size: its figures as fields, and the texts that they make.

    The name of its file is its label. Several classes in a file are variants of one finding, each a frozen dataclass.
    """

    label: ClassVar[str]
    topic: str
    """Topic, run or file on which it is."""

    def __init_subclass__(cls) -> None:
        cls.label = cls.__module__.rpartition(".")[2].replace("_", " ")
        dataclass(frozen=True, kw_only=True, eq=False)(cls)

    @property
    @abstractmethod
    def looks(self) -> str:
        """Words for what the data look like."""

    @property
    @abstractmethod
    def cure(self) -> Cure | str:
        """Settings that cure it, or words on what to do."""

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return place_in_docs(self.label)

    @property
    def text(self) -> str:
        """One line on what it looks like, and on its cure."""
        return self.written()

    def written(self, map_keys: Collection[str] = ()) -> str:
        """Return the same for a run whose conventions stand in a map with these keys."""
        return f"{self.looks}: {written(self.cure, map_keys)}"

    def verdict(self, *, axis: str, share: float, adds: str = "") -> ResidualCause:
        """Return it as an entry of a result.

        Args:
            axis: b1, b2 or b3; empty: none.
            share: part of the residuals' variance.
            adds: what it does to the tensor.
        """
        text = f"{self.topic}: {self.looks} ({self.label}); {written(self.cure)}{adds}"
        return ResidualCause(cause=self.label, axis=axis, share=share, text=text, run=self.topic, docs=self.docs)

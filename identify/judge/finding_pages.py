"""All findings with their pages: the docstring of each file, and an example of each of its variants."""

import importlib
import pkgutil
from typing import NamedTuple

from identify.judge.findings import Finding

ROOMS = ("identify.judge.run_findings", "identify.judge.conventions.findings")
"""Rooms with a file for each finding."""


class FindingPage(NamedTuple):
    """A finding as the documentation tells it."""

    label: str
    text: str
    """Docstring of its file, in Markdown: a sentence, then what it looks like, why it matters, and so on."""
    examples: tuple[Finding, ...]
    """A finding of each variant, with figures."""
    in_results: bool
    """Whether results have it among their warnings; else it is a suspicion of the recording."""

    @property
    def printed(self) -> list[str]:
        """Lines that commands print of the examples."""
        if self.in_results:
            return [example.verdict(axis="", share=0.0).text for example in self.examples]
        return [f"suspicious {example.topic}: {example.text}" for example in self.examples]

    @property
    def summary(self) -> str:
        """First sentence of the page: the finding in short."""
        return self.text.partition("\n")[0]

    @property
    def cure(self) -> str:
        """First sentence on the cure."""
        section = self.text.partition("## What to do\n")[2]
        return " ".join(section.split()).partition(". ")[0].rstrip(".") + "."


def all_findings() -> list[FindingPage]:
    """Return every finding that is no error with a size, with its page."""
    names = [f"{room}.{module.name}" for room in ROOMS for module in pkgutil.iter_modules(_path(room))]
    return [_page(name) for name in names]


def _path(room: str) -> list[str]:
    return list(importlib.import_module(room).__path__)


def _page(name: str) -> FindingPage:
    module = importlib.import_module(name)
    examples: tuple[Finding, ...] = module.EXAMPLES
    text = (module.__doc__ or "").strip()
    return FindingPage(examples[0].label, text, examples, in_results=name.startswith(ROOMS[0]))

"""A contradiction between a run's signals and mechanics, with its cure."""

from typing import NamedTuple


class Contradiction(NamedTuple):
    """One suspicion: what, on which topic, and what to do."""

    kind: str
    """Kind of the mistake: unit, sign, axes, mirror, turned, weight, mass or point."""
    topic: str
    text: str

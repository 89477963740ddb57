"""Assumptions of a result about errors, from the declared sources and from the kinds that none of them is of."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.display.text_tables import enumerated
from uq.report.figures.style import display_name
from uq.sources.source import KINDS, is_declared

NOUNS = {"F": "force", "M": "moment", "omega": "gyro", "wrench": "load cell"}
"""Words for the targets of kinds that act on several."""
DISTRIBUTIONS = {
    "Rectangular": "rectangular",
    "Triangular": "triangular",
    "UShaped": "arcsine",
    "StudentT": "Student's t",
    "Empirical": "from samples",
}
"""Words for distributions by their class; all but the normal."""


def source_assumptions(provenance: Mapping[str, Any]) -> list[str]:
    """Return what holds since no error of a kind is declared, and how those that are declared are drawn.

    Args:
        provenance: of a result, with the experiment's values in SI under ``resolved``; without them nothing is said.
    """
    resolved = provenance.get("resolved")
    if resolved is None:
        return []
    sources = resolved["sources"]
    absent = absences([(source["target"], source["kind"]) for source in sources])
    exact = [f"No declared source says otherwise: {'; '.join(absent)}."] if absent else []
    return [*exact, *_drawn(sources, resolved["mixing"])]


def absences(declared: Sequence[tuple[str, str]]) -> list[str]:
    """Return a clause for each kind of error on the targets where nothing that is declared does the same.

    Args:
        declared: target and kind of each source.
    """
    clauses = []
    for kind in dict.fromkeys(KINDS.values()):  # one of several targets stands there several times
        absent = [target for target in kind.targets if not is_declared(target, kind, declared)]
        if kind.absence and absent:
            clauses.append(kind.absence.format(enumerated([NOUNS.get(target, target) for target in absent])))
    return clauses


def _drawn(sources: Sequence[Mapping[str, Any]], mixing: Sequence[Mapping[str, Any]]) -> list[str]:
    kinds = {source["name"]: KINDS[source["target"], source["kind"]] for source in sources}
    drawn = [source for source in sources if kinds[source["name"]].constant or kinds[source["name"]].noise]
    if not drawn:
        return ["Nothing is drawn: no declared source is random."]
    shapes = {source["name"]: DISTRIBUTIONS.get(source["shape"]["class"]) for source in drawn}
    others = [f"{display_name(name)} ({shape})" for name, shape in shapes.items() if shape]
    shifted = [
        display_name(source["name"]) for source in drawn
        if kinds[source["name"]].constant and np.any(np.asarray(source["mean"], float))
    ]  # fmt: skip
    in_rows = [source["name"] for source in drawn if np.ndim(source["shape"].get("samples", 0)) == 2]
    together = [
        " with ".join(map(display_name, names)) for names in (*(m["names"] for m in mixing), *([n] for n in in_rows))
    ]
    memory = [display_name(name) for name, kind in kinds.items() if kind.noise and not kind.white]
    return [
        f"Declared errors are drawn from normal distributions{_but(others)}.",
        f"Their mean is zero{_but(shifted)}; they are independent of one another and axis by axis{_but(together)}.",
        f"Noise is drawn anew at each sample, white{_but(memory)}; every other error is drawn once an experiment.",
    ]


def _but(names: Sequence[str]) -> str:
    return f", but for {enumerated(names)}" if names else ""

"""The part of a recorded run that counts: named by ``--from`` and ``--to``, or found where the body moves."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from identify.signals.run import Run, RunError
from identify.signals.segments import decisive, moving
from rig.bags.marks import Mark

Limit = float | str
"""Seconds from the run's start, or the name of a mark."""


POINTS = 2000
"""Most points of a run's overview."""


class Part(NamedTuple):
    """From one limit to another; None: the run's start, or its end."""

    start: Limit | None = None
    stop: Limit | None = None


def limit(text: str) -> Limit:
    """Return what ``--from`` or ``--to`` means: seconds where it is a number, else the name of a mark."""
    try:
        return float(text)
    except ValueError:
        return text


def pair(limits: Sequence[tuple[str, str]]) -> tuple[Part, ...]:
    """Return the parts of ``("from", text)`` and ``("to", text)`` in the order in which they were given.

    A ``to`` ends the part that a ``from`` before it began, or begins at the run's start; a last ``from`` has the run's
    end.
    """
    parts: list[Part] = []
    begun: Limit | None = None
    for kind, text in limits:
        if kind == "to":
            parts.append(Part(begun, limit(text)))
            begun = None
        else:
            if begun is not None:
                parts.append(Part(begun))
            begun = limit(text)
    return tuple(parts if begun is None else [*parts, Part(begun)])


def resolve(
    parts: Sequence[Part], duration: float, marks: Sequence[tuple[float, str]], name: str
) -> tuple[tuple[float, float], ...]:
    """Return parts in seconds from the run's start.

    Args:
        parts: at least one.
        duration: of the run [s].
        marks: time from the run's start [s] and name of each.
        name: what to call the run.

    Raises:
        RunError: an unknown or ambiguous mark, a time outside the run, a part that runs backwards, two that overlap.
    """
    found = []
    for part in parts:
        start = 0.0 if part.start is None else _seconds(part.start, "--from", duration, marks, name)
        stop = duration if part.stop is None else _seconds(part.stop, "--to", duration, marks, name)
        if stop <= start:
            raise RunError(
                f"the part from {start:g} to {stop:g} s of {name} is empty or reversed: give --to after --from"
            )
        found.append((start, stop))
    found.sort()
    for (_, stop), (start, _) in pairwise(found):
        if start < stop:
            raise RunError(f"two parts of {name} overlap from {start:g} to {stop:g} s: give parts that do not")
    return tuple(found)


def _seconds(limit: Limit, option: str, duration: float, marks: Sequence[tuple[float, str]], name: str) -> float:
    times = [time for time, text in marks if text == limit]
    if isinstance(limit, str):
        if not times:
            known = ", ".join(sorted({text for _, text in marks})) or "none"
            raise RunError(f"no mark '{limit}' in {name} for {option}: give seconds or one of its marks ({known})")
        if len(times) > 1:
            raise RunError(f"{len(times)} marks '{limit}' in {name} for {option}: give seconds instead")
        limit = times[0]
    if not math.isfinite(limit) or limit < -1e-9 or limit > duration + 1e-9:
        raise RunError(f"{option} {limit:g} s is outside {name}, which lasts {duration:g} s: give a time in the run")
    return max(float(limit), 0.0)


def on_clock(marks: Sequence[Mark], log_time: np.ndarray, used: np.ndarray, start: int) -> list[tuple[float, str]]:
    """Return marks in seconds from the run's start, on the clock that its samples use [ns].

    Marks are on the log's clock; where the samples' stamps are on another (half a second apart or more), they are
    brought to it by the delay that the samples have.
    """
    apart = float(np.median(log_time - used))
    shift = apart if abs(apart) > 0.5e9 else 0.0
    return [((mark.time - shift - start) * 1e-9, mark.name) for mark in marks]


def cut(run: Run, parts: Sequence[Part] | None, marks: Sequence[tuple[float, str]]) -> Run:
    """Return the part of a run that counts: the named ones, else the stretches in which its motion tells of the tensor.

    Raises:
        RunError: see :func:`resolve`.
    """
    if parts:
        kept = run.within(resolve(parts, float(run.t[-1]), marks, run.name))
        return replace(kept, overview=_overview(run))
    stretches = moving(run.rate, run.omega)
    found = decisive(run.rate, run.omega, run.force, run.moment, stretches)
    if not found or (found[0].start == 0 and found[0].stop >= float(run.t[-1] - run.t[0]) - 0.5 / run.rate):
        return run
    first, last = float(run.t[0]), float(run.t[-1])
    return replace(run.within((first + a, min(first + b, last)) for a, b in found), found=True, overview=_overview(run))


def _overview(run: Run) -> np.ndarray:
    """Time and largest angular velocity of each of up to ``POINTS`` equal spans of a run, (m, 2)."""
    width = -(-len(run.t) // POINTS)
    count = len(run.t) // width
    speed = np.linalg.norm(run.omega[: count * width], axis=1).reshape(count, width).max(axis=1)
    return np.stack([run.t[: count * width : width], speed], axis=1)

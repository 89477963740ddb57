"""The time windows of a recorded run that count: those of ``--from`` and ``--to``, or the segments that move."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from identify.signals.run import Run, RunError
from identify.signals.segments import decisive, moving
from rig.bags.marks import Mark
from rig.exceptions import listed, quoted

Limit = float | str
"""Seconds from the run's start, or the name of a mark."""


POINTS = 2000
"""Most points of a run's overview."""


class TimeWindow(NamedTuple):
    """A window from one limit to another; None: the run's start, or its end."""

    start: Limit | None = None
    stop: Limit | None = None


def names_marks(windows: Sequence[TimeWindow] | None) -> bool:
    """Whether some limit is the name of a mark."""
    return any(isinstance(limit, str) for window in windows or () for limit in window)


def limit(text: str) -> Limit:
    """Return what ``--from`` or ``--to`` means: seconds where it is a number, else the name of a mark."""
    try:
        return float(text)
    except ValueError:
        return text


def windows_of_options(limits: Sequence[tuple[str, str]]) -> tuple[TimeWindow, ...]:
    """Return the windows that ``("from", text)`` and ``("to", text)`` limit, in the order in which they were given.

    A ``to`` ends the window that a ``from`` before it opened, or one from the run's start; a last ``from`` reaches to
    the run's end.
    """
    windows: list[TimeWindow] = []
    start: Limit | None = None
    for kind, text in limits:
        if kind == "to":
            windows.append(TimeWindow(start, limit(text)))
            start = None
        else:
            if start is not None:
                windows.append(TimeWindow(start))
            start = limit(text)
    return tuple(windows if start is None else [*windows, TimeWindow(start)])


def resolve(
    windows: Sequence[TimeWindow], duration: float, marks: Sequence[tuple[float, str]], name: str
) -> tuple[tuple[float, float], ...]:
    """Return time windows in seconds from the run's start.

    Args:
        windows: at least one.
        duration: of the run [s].
        marks: time from the run's start [s] and name of each.
        name: what to call the run.

    Raises:
        RunError: an unknown or ambiguous mark, a time outside the run, a window that runs backwards, two that overlap.
    """
    spans = []
    for window in windows:
        start = 0.0 if window.start is None else _seconds(window.start, "--from", duration, marks, name)
        stop = duration if window.stop is None else _seconds(window.stop, "--to", duration, marks, name)
        if stop <= start:
            raise RunError(
                f"the part from {start:g} to {stop:g} s of {name} is empty or reversed: give --to after --from"
            )
        spans.append((start, stop))
    spans.sort()
    for (_, stop), (start, _) in pairwise(spans):
        if start < stop:
            raise RunError(f"two parts of {name} overlap from {start:g} to {stop:g} s: give parts that do not")
    return tuple(spans)


def _seconds(limit: Limit, option: str, duration: float, marks: Sequence[tuple[float, str]], name: str) -> float:
    times = [time for time, text in marks if text == limit]
    if isinstance(limit, str):
        if not times:
            names = listed(sorted({text for _, text in marks})) or "none"
            cure = f"give seconds or one of its marks ({names})"
            raise RunError(f"no mark {quoted(limit)} in {name} for {option}: {cure}")
        if len(times) > 1:
            raise RunError(f"{len(times)} marks {quoted(limit)} in {name} for {option}: give seconds instead")
        limit = times[0]
    if not math.isfinite(limit) or limit < -1e-9 or limit > duration + 1e-9:
        raise RunError(f"{option} {limit:g} s is outside {name}, which lasts {duration:g} s: give a time in the run")
    return max(float(limit), 0.0)


def on_clock(marks: Sequence[Mark], log_time: np.ndarray, used: np.ndarray, start: int) -> list[tuple[float, str]]:
    """Return marks in seconds from the run's start, on the clock that its samples use [ns].

    Marks are on the log's clock; where the samples' stamps are on another (half a second apart or more), they are
    brought to it by the delay that the samples have.
    """
    delay = float(np.median(log_time - used))
    shift = delay if abs(delay) > 0.5e9 else 0.0
    return [((mark.time - shift - start) * 1e-9, mark.name) for mark in marks]


def cut(run: Run, windows: Sequence[TimeWindow] | None, marks: Sequence[tuple[float, str]]) -> Run:
    """Return the windows of a run that are given, else the segments whose motion determines the tensor.

    Raises:
        RunError: see :func:`resolve`.
    """
    if windows:
        chosen = run.within(resolve(windows, float(run.t[-1]), marks, run.name))
        return replace(chosen, overview=_overview(run))
    segments = decisive(run.rate, run.omega, run.force, run.moment, moving(run.rate, run.omega))
    first, last = float(run.t[0]), float(run.t[-1])
    if not segments or (segments[0].start == 0 and segments[0].stop >= last - first - 0.5 / run.rate):
        return run
    spans = ((first + start, min(first + stop, last)) for start, stop in segments)
    return replace(run.within(spans), detected=True, overview=_overview(run))


def _overview(run: Run) -> np.ndarray:
    """Time and largest angular velocity of each of up to ``POINTS`` equal spans of a run, (m, 2)."""
    width = -(-len(run.t) // POINTS)
    count = len(run.t) // width
    speed = np.linalg.norm(run.omega[: count * width], axis=1).reshape(count, width).max(axis=1)
    return np.stack([run.t[: count * width : width], speed], axis=1)

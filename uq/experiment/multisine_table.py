"""Amplitudes of a multi-frequency trajectory: a CSV table, one frequency of one stage a row."""

from pathlib import Path

import numpy as np

from identify.motion.multisine import Multisine
from uq.files.mistakes import ExperimentError

COORDINATES = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
"""Displacement of the platform's centre in A, and rotation vector."""
COLUMNS = ("frequency_hz", *(f"{phase}_{name}" for phase in ("cos", "sin") for name in COORDINATES))
START = "start_s"
"""The column before these in a table of stages: rows of one start are a stage, which ends when the next one starts."""


def read_multisine(where: str, path: Path, *, duration: np.ndarray, ramp: np.ndarray) -> Multisine:
    """Return the trajectory whose amplitudes a table holds.

    Args:
        where: the key that names the file, for messages.
        path: the table, with the columns ``COLUMNS``; for a motion in stages ``START`` before them.
        duration: of the motion [s].
        ramp: time to start and to stop each stage [s].

    Raises:
        ExperimentError: the file is missing, is no such table, or its stages do not follow one another.
    """
    if not path.is_file():
        raise ExperimentError(f"no file {path} at {where}: give its path relative to the experiment's folder")
    lines = path.read_text("utf-8", errors="replace").split()
    columns = tuple(lines[0].split(",")) if lines else ()
    if columns not in (COLUMNS, (START, *COLUMNS)):
        raise ExperimentError(
            f"the first line of {path} at {where} names other columns: write {','.join(COLUMNS)}, "
            f"with {START} before them for a motion in stages"
        )
    try:
        rows = np.array([[float(item) for item in line.split(",")] for line in lines[1:]])
    except ValueError:
        rows = np.array(np.nan)
    if rows.shape != (len(rows.reshape(-1, 1)) // len(columns), len(columns)) or not np.isfinite(rows).all():
        raise ExperimentError(f"{path} at {where} holds a row that is not {len(columns)} finite numbers: correct it")
    start, rows = (rows[:, 0], rows[:, 1:]) if columns[0] == START else (np.zeros(len(rows)), rows)
    if not len(rows) or (rows[:, 0] <= 0).any():
        raise ExperimentError(f"{path} at {where} holds no frequency, or one that is not above zero: correct it")
    _check_stages(f"{path} at {where}", start, float(duration), float(ramp))
    return Multisine(
        frequency=rows[:, 0], cosine=rows[:, 1:7].T, sine=rows[:, 7:].T, duration=duration, ramp=ramp,
        start=start if start.any() else None,
    )  # fmt: skip


def _check_stages(place: str, start: np.ndarray, duration: float, ramp: float) -> None:
    if start[0] != 0:
        raise ExperimentError(f"{place}: {START} begins with {start[0]:g}: the first stage starts at 0")
    if (np.diff(start) < 0).any():
        raise ExperimentError(f"{place}: {START} decreases: write the stages in order of time")
    starts = np.unique(start)
    lasts = np.diff([*starts, duration])
    if lasts.min() < 2 * ramp * (1 - 1e-12):
        first = starts[lasts.argmin()]
        raise ExperimentError(
            f"{place}: the stage from {first:g} s lasts {lasts.min():g} s: it has two ramps of {ramp:g} s"
        )


def multisine_csv(trajectory: Multisine) -> str:
    """Return the table of a trajectory's amplitudes, every digit of them."""
    columns = [trajectory.frequency, *np.asarray(trajectory.cosine), *np.asarray(trajectory.sine)]
    names = COLUMNS
    if trajectory.start is not None:
        columns, names = [trajectory.start, *columns], (START, *COLUMNS)
    rows = np.stack([np.asarray(column) for column in columns], axis=1)
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"

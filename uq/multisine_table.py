"""Amplitudes of a multi-frequency trajectory: a CSV table, one frequency a row."""

from pathlib import Path

import numpy as np

from identify.trajectory import Multisine
from uq.document import ExperimentError

COORDINATES = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")
"""Displacement of the platform's centre in A, and rotation vector."""
COLUMNS = ("frequency_hz", *(f"{part}_{name}" for part in ("cos", "sin") for name in COORDINATES))


def read_multisine(where: str, path: Path, *, duration: np.ndarray, ramp: np.ndarray) -> Multisine:
    """Return the trajectory whose amplitudes a table holds.

    Args:
        where: the key that names the file, for messages.
        path: the table, with the columns ``COLUMNS``.
        duration: of the motion [s].
        ramp: time to start and to stop [s].

    Raises:
        ExperimentError: the file is missing, or is no such table.
    """
    if not path.is_file():
        raise ExperimentError(f"no file {path} at {where}: give its path from the experiment's folder")
    lines = path.read_text("utf-8", errors="replace").split()
    if not lines or tuple(lines[0].split(",")) != COLUMNS:
        raise ExperimentError(f"the first line of {path} at {where} names other columns: write {','.join(COLUMNS)}")
    try:
        rows = np.array([[float(item) for item in line.split(",")] for line in lines[1:]])
    except ValueError:
        rows = np.array(np.nan)
    if rows.shape != (len(rows.reshape(-1, 1)) // len(COLUMNS), len(COLUMNS)) or not np.isfinite(rows).all():
        raise ExperimentError(f"{path} at {where} holds a row that is not {len(COLUMNS)} finite numbers: correct it")
    if not len(rows) or (rows[:, 0] <= 0).any():
        raise ExperimentError(f"{path} at {where} holds no frequency, or one that is not above zero: correct it")
    return Multisine(rows[:, 0], rows[:, 1:7].T, rows[:, 7:].T, duration, ramp)


def multisine_csv(trajectory: Multisine) -> str:
    """Return the table of a trajectory's amplitudes, every digit of them."""
    rows = np.hstack([np.asarray(part).T for part in (trajectory.frequency[None], trajectory.cosine, trajectory.sine)])
    return "\n".join([",".join(COLUMNS), *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"

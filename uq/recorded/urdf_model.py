"""A robot's description, URDF, read by the optional package Pinocchio."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rig.exceptions import RigError, listed, on_one_line, quoted, reason
from uq.files.document import ExperimentError


def urdf_model(urdf: str, key: str, what: str) -> Any:
    """Return Pinocchio's model of a URDF.

    Args:
        urdf: its path.
        key: which key of the experiment names it.
        what: what needs it, in the plural.

    Raises:
        ExperimentError: there is no such file, or it is no URDF.
        RigError: Pinocchio is not installed.
    """
    try:
        import pinocchio
    except ImportError:
        raise RigError(f"{what} need Pinocchio: `pip install inertia-uq[urdf]` installs it") from None
    if not Path(urdf).is_file():
        raise ExperimentError(f"no file {urdf} at {key}: give its path from the experiment's folder")
    try:
        with silence():
            model = pinocchio.buildModelFromXML(Path(urdf).read_bytes().decode())
        _ = list(model.names), [frame.name for frame in model.frames]
    except (ValueError, RuntimeError) as error:
        first = on_one_line(str(error).strip().partition("\n")[0]) or "it cannot be parsed"
        raise ExperimentError(f"no URDF {urdf} at {key} ({reason(first)}): give a robot's description") from None
    return model


def frame_number(model: Any, frame: str, urdf: str, key: str) -> int:
    """Return the number of a frame of a model.

    Raises:
        ExperimentError: there is no such frame.
    """
    if not model.existFrame(frame):
        frames = listed(each.name for each in model.frames if each.name != "universe")
        raise ExperimentError(f"unknown frame {quoted(frame)} at {key}: {urdf} has {frames}")
    return int(model.getFrameId(frame))


def joint_axis(model: Any, number: int, urdf: str) -> np.ndarray:
    """Return the axis of a joint in its frame: linear, then angular, (6,); one of the two is a unit vector.

    Raises:
        ExperimentError: it has no direction: of zeros or of huge numbers, the library makes none.
    """
    joint = model.joints[number]
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0][: joint.nq]), np.zeros(1))
    axis = np.asarray(data.S, float).ravel()
    if not abs(float(np.linalg.norm(axis)) - 1.0) < 1e-9:
        raise ExperimentError(
            f"no direction in the axis of joint {quoted(model.names[number])} of {Path(urdf).name}: "
            'correct it, such as xyz="0 0 1"'
        )
    return axis


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Keep what a C++ library writes from standard error: what it raises is said."""
    sys.stderr.flush()
    try:
        before = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    os.close(nothing)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)

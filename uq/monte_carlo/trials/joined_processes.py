"""Several processes, on one machine or many, as one campaign: each computes its share, and all get all results.

JAX's runtime lets the processes meet, exchange arrays and notice a lost one. This module adds what a campaign needs
besides: steps that the first process takes before the others, and one line when a process is lost.
"""

import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import jax
import numpy as np
from jax.experimental import multihost_utils

from rig.exceptions import reason
from uq.files.mistakes import ExperimentError

T = TypeVar("T")

PATIENCE = 60
"""Seconds to wait for all processes at the start."""
HEARTBEAT = 30
"""Seconds without a heartbeat after which a process counts as lost."""
LONGEST_MESSAGE = 2000
LOST_LINE = "another process of the campaign has ended: run the same command again to continue from --out"


class LostProcess(ExperimentError):  # noqa: N818
    """Another process of the campaign is gone."""


class FailedElsewhere(ExperimentError):  # noqa: N818
    """The first process failed; the message is its reason."""


def join(
    coordinator: str | None = None, processes: int | None = None, process: int | None = None, patience: int = PATIENCE
) -> None:
    """Join the other processes; before the first array is made.

    Args:
        coordinator: ``HOST:PORT`` where the first process listens.
        processes: how many there are.
        process: which of them this is, from 0. Without all three, the cluster's environment gives them (Slurm,
            Open MPI, …: :func:`jax.distributed.initialize`).
        patience: seconds to wait for the others.

    Raises:
        ExperimentError: no cluster is detected, or the others do not come.
    """
    jax.config.update("jax_cpu_collectives_implementation", "gloo")
    try:
        with _silent():
            jax.distributed.initialize(
                coordinator, processes, process, initialization_timeout=patience, heartbeat_timeout_seconds=HEARTBEAT
            )
            multihost_utils.sync_global_devices("joined")
    except (ValueError, TypeError, RuntimeError) as error:
        if jax.distributed.is_initialized():
            raise LostProcess(f"the {processes or 'other'} processes did not connect: start them again") from None
        if (coordinator is None and "must be defined" in str(error)) or "should be defined" in str(error):
            raise ExperimentError(
                "no cluster is detected: give --coordinator HOST:PORT --processes N --process I"
            ) from None
        where = f" at {coordinator}" if coordinator else ""
        what = reason(str(error).partition("\n")[0])
        raise ExperimentError(f"the processes cannot connect{where} ({what}): check address and number") from None


def leave() -> None:
    """Wait for the others and disconnect."""
    jax.distributed.shutdown()


def several() -> bool:
    """Whether there are other processes."""
    return jax.process_count() > 1


def is_first() -> bool:
    """Whether this is the first process, which prints and writes for all."""
    return jax.process_index() == 0


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """Turn what a collective raises when another process is gone into one line.

    Raises:
        LostProcess: another process is gone.
    """
    try:
        yield
    except (ValueError, RuntimeError) as error:
        if not several() or isinstance(error, ExperimentError):
            raise
        raise LostProcess(LOST_LINE) from error


def meet() -> None:
    """Wait for the other processes, if there are any."""
    if several():
        with guarded():
            multihost_utils.sync_global_devices("meet")


def in_turn(action: Callable[[], T]) -> T:
    """Do something on the first process, then on the others; where it fails on the first, it fails on all.

    Raises:
        FailedElsewhere: the first process failed.
        LostProcess: another process is gone.
    """
    if not several():
        return action()
    if not is_first():
        if message := _from_first(""):
            raise FailedElsewhere(message)
        return action()
    try:
        done = action()
    except Exception as error:
        _from_first(str(error) or type(error).__name__)
        raise
    _from_first("")
    return done


def agree(what: str, value: Any) -> None:
    """Check that all processes have the same value.

    Raises:
        ExperimentError: the first process has another.
    """
    digest = hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()
    if several() and _from_first(digest) != digest:
        raise ExperimentError(f"the processes have different {what}: start all alike, with --out on shared disk")


def _from_first(message: str) -> str:
    """Return the first process's message, on every process."""
    text = np.zeros(4 * LONGEST_MESSAGE, np.uint8)
    data = message[:LONGEST_MESSAGE].encode()
    text[: len(data)] = np.frombuffer(data, np.uint8)
    with guarded():
        received = np.asarray(multihost_utils.broadcast_one_to_all(text))
    return bytes(received[received > 0]).decode()


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Keep the transport's messages from standard output."""
    sys.stdout.flush()
    standard_output, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    try:
        yield
    finally:
        os.dup2(standard_output, 1)
        os.close(standard_output)
        os.close(nothing)

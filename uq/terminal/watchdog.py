"""A process that watches another: where the runtime of several processes aborts, one line gives the reason.

JAX's runtime ends a process at once, with a page of its own, when it finds the first process of a campaign gone. So the
command divides before it loads anything: one process computes, the other waits for its end and prints the reason.
"""

import contextlib
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Iterator

LOST = 3
"""Exit status when another process of a campaign is gone."""
ALONE = 2
"""Exit status when the other processes do not come at the start."""
ALONE_LINE = "the other processes did not join in time: start all of them, or allow more time with --patience"
_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)
_have_met = -1
"""Descriptor to which the process that computes writes a byte once it has met the others."""


def divide() -> int | None:
    """Divide into a process that goes on (None) and one that waits for it; return the latter's exit status.

    The process that goes on ends when the other is killed (on Linux), and keeps the runtime's messages from standard
    error. Where the system cannot divide a process (Windows) it goes on undivided, and such a message is seen.
    """
    if not hasattr(os, "fork"):
        return None
    sys.stdout.flush()
    sys.stderr.flush()
    global _have_met
    parent = os.getpid()
    met, _have_met = os.pipe()
    child = os.fork()
    if child:
        os.close(_have_met)
        return _wait(child, met)
    os.close(met)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
    sys.stderr = os.fdopen(os.dup(2), "w", buffering=1, errors="replace")
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    os.close(nothing)
    return None


def say_met() -> None:
    """Tell the process that waits, if there is one, that this one has met the others of its campaign."""
    if _have_met >= 0:
        os.write(_have_met, b"1")


@contextlib.contextmanager
def patient(seconds: float) -> Iterator[None]:
    """Let this process abort where it has not met the others in time; JAX's runtime takes twice the time it is given.

    Only where another one waits for it, which says why.
    """
    timer = threading.Timer(seconds, os.abort)
    timer.daemon = True
    if _have_met >= 0:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _wait(child: int, met: int) -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal interrupts both; the other one answers
    signal.signal(signal.SIGTERM, lambda number, frame: os.kill(child, number))
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code == -signal.SIGABRT:
        from uq.trials.joined_processes import LOST_LINE  # loads JAX, with which a process must not divide

        line, status = (LOST_LINE, LOST) if os.read(met, 1) else (ALONE_LINE, ALONE)
        sys.stderr.write(f"error: {line}\n")
        return status
    if code < 0:
        sys.stderr.write(f"error: ended by {signal.Signals(-code).name}\n")
        return 128 - code
    return code

"""The second process of ``inertia record --identify``: ``python -m uq.runs.live RIG E RUN``.

Prints a line of JSON when it is ready, or why it cannot be, and one for each estimate. It ends when its standard input
does: the recording is over, or its process is gone.
"""

import argparse
import contextlib
import json
import os
import signal
import sys
import threading
import time
from typing import Any

PAUSE = 0.25
"""Seconds between two looks at the file."""
NICE = 5
"""Increment of the process's niceness, so that the recorder has priority."""


def main(arguments: list[str]) -> int:
    """Run until the recording is over."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # the terminal's signals are for the recording
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_the_recording, daemon=True).start()
    if hasattr(os, "nice"):
        os.nice(NICE)
    parser = argparse.ArgumentParser(prog="uq.runs.live")
    for name in ("rig", "experiment", "run"):
        parser.add_argument(name)
    parser.add_argument("--target", type=float, help="half the interval of 95 %% [kg*m^2]")
    given = parser.parse_args(arguments)
    import jax

    jax.config.update("jax_enable_x64", True)
    from uq.files.compilation_cache import keep_compiled
    from uq.files.mistakes import MISTAKES
    from uq.runs.live.estimator import LiveEstimator

    keep_compiled()
    try:
        estimator = LiveEstimator(given.rig, given.experiment, given.run, given.target)
    except MISTAKES as error:
        _say({"refused": str(error)})
        return 2
    except OSError as error:
        _say({"refused": f"{error.strerror or error} {error.filename}: check the path and its permissions"})
        return 2
    _say({"ready": True})
    while not estimator.ended:
        time.sleep(PAUSE)
        estimate = estimator.step()
        if estimate is not None:
            _say(estimator.message(estimate))
    return 0


def _end_with_the_recording() -> None:
    with contextlib.suppress(OSError, ValueError):
        while os.read(sys.stdin.fileno(), 4096):
            pass
    os._exit(0)


def _say(message: dict[str, Any]) -> None:
    sys.stdout.write(f"{json.dumps(message)}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

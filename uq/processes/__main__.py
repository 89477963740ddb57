"""A process that does tasks: ``python -m uq.processes``, a task a message of its standard input, an answer a message.

It ends when its standard input does, in the midst of a task, too: whoever started it is gone or wants no more.
"""

import contextlib
import os
import pickle
import queue
import signal
import sys
import threading
import traceback
from typing import Any

from uq.processes.messages import receive, send


def main() -> int:
    """Do tasks until there are no more."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # the terminal's signals are for the command
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks,), daemon=True).start()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    import jax

    jax.config.update("jax_enable_x64", True)
    from uq.files.compilation_cache import keep_compiled

    keep_compiled()
    while True:
        send(answers, _answer(tasks.get()))


def _answer(task: bytes) -> bytes:
    """Return the message with a task's value, or with the exception that it ended with."""
    answer: tuple[Any, Exception | None]
    try:
        function, item = pickle.loads(task)  # noqa: S301 - from the process that started this one
        answer = function(item), None
    except Exception as error:
        error.add_note(traceback.format_exc())
        answer = None, error
    return pickle.dumps(answer, protocol=5)


def _listen(tasks: "queue.SimpleQueue[bytes]") -> None:
    with contextlib.suppress(OSError, ValueError):
        while (task := receive(sys.stdin.buffer)) is not None:
            tasks.put(task)
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())

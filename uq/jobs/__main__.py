"""A process that does jobs: ``python -m uq.jobs OUT``, a job in JSON a line of its standard input, an answer a line.

It ends when its standard input does, in the midst of a job, too: whoever started it is gone or wants no more.
"""

import contextlib
import json
import os
import queue
import signal
import sys
import threading
from pathlib import Path
from typing import Any

OUT_OF_MEMORY = "out of memory: give this process more, run fewer with --processes, or take shorter runs"


def main(out: str) -> int:
    """Do jobs until there are no more."""
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):  # the terminal's signals are for the command
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(lines,), daemon=True).start()
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints is no answer
    import jax

    jax.config.update("jax_enable_x64", True)
    from uq.files.compilation_cache import keep_compiled

    keep_compiled()
    while True:
        answer = _answer(json.loads(lines.get()), Path(out))
        answers.write(f"{json.dumps(answer)}\n")
        answers.flush()


def _answer(content: dict[str, Any], out: Path) -> dict[str, str]:
    from uq.jobs.job_work import failed, work
    from uq.jobs.jobs_file import Job

    try:
        return work(Job(**content), out)
    except MemoryError:
        return failed(OUT_OF_MEMORY)
    except Exception as error:  # a fault of this program in one job costs no other
        text = f"{type(error).__name__}: {error}"
        return failed(OUT_OF_MEMORY if "RESOURCE_EXHAUSTED" in text else f"a fault of this program: {text}")


def _listen(lines: "queue.SimpleQueue[str]") -> None:
    with contextlib.suppress(OSError, ValueError):
        for line in sys.stdin:
            lines.put(line)
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))

"""Processes that do jobs, each one after another; a process that dies costs its job alone."""

import contextlib
import json
import os
import queue
import subprocess
import tempfile
import threading
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

from rig.child_process import ChildProcess, start_module
from rig.exceptions import on_one_line
from uq.jobs.jobs_file import Job

LOOK = 0.2
"""Seconds between two looks for Ctrl-C, which not every system lets break a wait."""


def answers_of(jobs: Sequence[Job], out: Path, processes: int) -> Generator[tuple[Job, dict[str, Any]], None, None]:
    """Yield each job with what its process says of it, in the order in which they end.

    All processes end when the iterator is closed, and so with Ctrl-C.

    Args:
        jobs: the jobs.
        out: folder of their folders.
        processes: most processes at a time.
    """
    waiting: queue.SimpleQueue[Job] = queue.SimpleQueue()
    answered: queue.SimpleQueue[tuple[Job, dict[str, Any]]] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    workers = [_Worker(waiting, answered, out) for _ in range(min(processes, len(jobs)))]
    try:
        for _ in jobs:
            while True:
                try:
                    answer = answered.get(timeout=LOOK)
                    break
                except queue.Empty:
                    continue
            yield answer
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A thread that hands jobs to a process, and starts another one when it has died."""

    def __init__(
        self,
        waiting: "queue.SimpleQueue[Job]",
        answered: "queue.SimpleQueue[tuple[Job, dict[str, Any]]]",
        out: Path,
    ) -> None:
        self.waiting, self.answered, self.out = waiting, answered, out
        self.lock, self.over = threading.Lock(), False
        self.process: ChildProcess | None = None
        self.errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed by end
        self.thread = threading.Thread(target=self._work, daemon=True)
        self.thread.start()

    def end(self) -> None:
        """End process and thread."""
        with self.lock:
            self.over = True
            if self.process is not None:
                self.process.kill()
        self.thread.join()
        self.errors.close()

    def _work(self) -> None:
        while not self.over:
            try:
                job = self.waiting.get_nowait()
            except queue.Empty:
                break
            try:
                answer = self._answer(job)
            except OSError as error:
                answer = _failed(f"no process can be started: {error.strerror or error}")
            if not self.over:
                self.answered.put((job, answer))
        self._close()

    def _answer(self, job: Job) -> dict[str, Any]:
        process = self._started()
        if process is None or process.stdin is None or process.stdout is None:
            return _failed("interrupted")
        try:
            process.stdin.write(f"{json.dumps(job.to_dict())}\n".encode())
            process.stdin.flush()
            line = process.stdout.readline()
        except BrokenPipeError:
            line = b""
        if line.endswith(b"\n"):
            return dict(json.loads(line))
        process.wait()
        answer = _failed(self._why(process.returncode))
        self._close()
        return answer

    def _started(self) -> ChildProcess | None:
        """The process, started if there is none; None: it is over."""
        with self.lock:
            if self.process is None and not self.over:
                self.errors.seek(0)
                self.errors.truncate()
                self.process = start_module(
                    "uq.jobs", str(self.out),
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors, start_new_session=True,
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "TF_CPP_MIN_LOG_LEVEL": "3"},
                )  # fmt: skip
            return self.process

    def _why(self, status: int) -> str:
        if status < 0:
            killed = " (out of memory? run fewer with --processes)" if status == -9 else ""
            return f"its process was ended by signal {-status}{killed}"
        self.errors.seek(0)
        lines = self.errors.read().decode("utf-8", "replace").strip().splitlines()
        return f"its process ended with status {status}{f' ({lines[-1]})' if lines else ''}"

    def _close(self) -> None:
        with self.lock:
            process, self.process = self.process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(OSError):  # nobody reads what is left in it
                        pipe.close()


def _failed(line: str) -> dict[str, Any]:
    return {"status": "failed", "verdict": "failed", "line": on_one_line(line), "note": ""}

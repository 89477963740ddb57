"""Processes that do tasks, each one after another; a process that dies costs its task alone."""

import contextlib
import os
import pickle
import queue
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

from rig.child_process import ChildProcess, processors, start_module
from uq.processes.messages import receive, send
from uq.progress_bar import Progress

T = TypeVar("T")
R = TypeVar("R")
LOOK = 0.2
"""Seconds between two looks for Ctrl-C, which not every system lets break a wait."""


class Answer(NamedTuple):
    """Result of a task, or why there is none."""

    number: int
    value: Any = None
    error: BaseException | None = None
    """The exception that the task ended with; None: it did not."""
    died: str = ""
    """Words on how the task's process died; empty: it lives."""

    def result(self) -> Any:
        """Return the value, or raise the exception that the task ended with."""
        if self.error is not None:
            raise self.error
        return self.value


class Calls:
    """Calls of a function of a module with each of some items; both are pickled."""

    def __init__(self, function: Callable[[Any], Any], items: Iterable[Any]) -> None:
        self.function, self.items = function, list(items)
        self.answered: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        self.wanted = True
        """Whether calls that nobody has begun are still to be made."""

    def answer(self, number: int) -> Answer:
        """Return the answer to the call with an item of this number, made here."""
        try:
            return Answer(number, self.function(self.items[number]) if self.wanted else None)
        except Exception as error:
            return Answer(number, error=error)


class Task(NamedTuple):
    """One of the calls, in the order in which they are begun: those handed out last come first, their items in turn."""

    rank: float
    """Rank of the calls: the last ones have the lowest."""
    number: int
    calls: Calls | None
    """Calls that it is one of; None: there are no more tasks."""


NO_MORE = Task(float("inf"), 0, None)


class ProcessPool:
    """A context of processes that start with their first task and end with it, and so with Ctrl-C."""

    def __init__(self, processes: int, *, helping: bool = False, progress: Progress = lambda *_: None) -> None:
        """State the most processes at a time, and whether this one does tasks, too, instead of waiting for answers.

        ``progress`` is called by :meth:`map` with "runs", the values that there are, and how many are wanted.
        """
        self.helping, self.progress, self.called = helping, progress, 0
        self.waiting: queue.PriorityQueue[Task] = queue.PriorityQueue()
        self.workers = [_Worker(self.waiting) for _ in range(processes)]

    def __enter__(self) -> "ProcessPool":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for worker in self.workers:
            worker.kill()
            self.waiting.put(NO_MORE)  # whichever thread it wakes: all of them are to end before one is waited for
        for worker in self.workers:
            worker.join()

    def answers(self, function: Callable[[T], Any], items: Iterable[T]) -> Iterator[Answer]:
        """Yield the answers to a function's calls with each item, numbered as these, in the order in which they end.

        No further tasks come: a process that finds none ends.
        """
        calls = self._handed_out(function, items)
        for _ in self.workers:
            self.waiting.put(NO_MORE)
        for _ in calls.items:
            yield self._answer(calls)

    def map(self, function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
        """Return an iterator of a function's values of each item, in their order, as the builtin of this name.

        The calls are begun at once, but after those of any later map: what is asked for early and looked at late is
        done where a process would have nothing to do.

        Raises:
            Exception: with the iterator, that of the first item whose call raises one, as if they were called in turn.
            MemoryError: a process died.
        """
        return self._values(self._handed_out(function, items))

    def _values(self, calls: Calls) -> Iterator[Any]:
        answers: list[Answer] = []
        while len(answers) < len(calls.items):
            self.progress("runs", len(answers), len(calls.items))
            answers.append(answer := self._answer(calls))
            if answer.died or answer.error is not None:  # of those behind it none is wanted
                calls.wanted = False
        for answer in sorted(answers):
            if answer.died:
                raise MemoryError(answer.died)
            yield answer.result()

    def _handed_out(self, function: Callable[[T], Any], items: Iterable[T]) -> Calls:
        calls, self.called = Calls(function, items), self.called + 1
        for number in range(len(calls.items)):
            self.waiting.put(Task(-self.called, number, calls))
        return calls

    def _answer(self, calls: Calls) -> Answer:
        while True:
            with contextlib.suppress(queue.Empty):
                return calls.answered.get_nowait()
            with contextlib.suppress(queue.Empty):
                if self.helping:
                    task = self.waiting.get_nowait()
                    if task.calls is not None:
                        task.calls.answered.put(task.calls.answer(task.number))
                    continue
            with contextlib.suppress(queue.Empty):
                return calls.answered.get(timeout=LOOK)


FEWEST = 8
"""Runs for each process, at least: one takes 0.7 s to start, eight runs of 30 s at 400 Hz take 2.4 s."""


@contextlib.contextmanager
def run_map(runs: int, processes: int | None, progress: Progress) -> Iterator[Callable[..., Iterable[Any]]]:
    """Yield the builtin ``map`` or, where it pays, one that shares its items among processes.

    Each value is computed as it would be here, by one thread of BLAS: the same bits, whatever the number of processes.

    Args:
        runs: number of items.
        processes: most processes; None: as many as there are processors.
        progress: called with "runs", how many were looked at, and how many of them there are.
    """
    count = min(processes or processors(), runs // FEWEST)
    if count < 2:
        yield map
        return
    helping = os.environ.get("OPENBLAS_NUM_THREADS") == "1"  # else its own sums may have other bits
    with ProcessPool(count - helping, progress=progress, helping=helping) as pool:
        yield pool.map


class _Worker:
    """A thread that hands tasks to a process, which it starts for the first, and anew when it has died."""

    def __init__(self, waiting: "queue.PriorityQueue[Task]") -> None:
        self.waiting = waiting
        self.lock, self.over = threading.Lock(), False
        self.process: ChildProcess | None = None
        self.errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed by end
        self.thread = threading.Thread(target=self._work, daemon=True)
        self.thread.start()

    def kill(self) -> None:
        """End the process, and begin no other."""
        with self.lock:
            self.over = True
            if self.process is not None:
                self.process.kill()

    def join(self) -> None:
        """Wait for the end of the thread."""
        self.thread.join()
        self.errors.close()

    def _work(self) -> None:
        while not self.over:
            _, number, calls = self.waiting.get()
            if calls is None:
                break
            try:
                answer = self._answer(calls, number)
            except OSError as error:
                answer = Answer(number, died=f"no process can be started: {error.strerror or error}")
            except Exception as error:  # what cannot be pickled
                answer = Answer(number, error=error)
            if not self.over:
                calls.answered.put(answer)
        self._close()

    def _answer(self, calls: Calls, number: int) -> Answer:
        if not calls.wanted:
            return Answer(number)
        process = self._started()
        if process is None or process.stdin is None or process.stdout is None:
            return Answer(number, died="interrupted")
        message = pickle.dumps((calls.function, calls.items[number]), protocol=5)
        answer = None
        with contextlib.suppress(BrokenPipeError):
            send(process.stdin, message)
            answer = receive(process.stdout)
        if answer is not None:
            return Answer(number, *pickle.loads(answer))  # noqa: S301 - from a process of ours
        process.wait()
        died = self._why(process.returncode)
        self._close()
        return Answer(number, died=died)

    def _started(self) -> ChildProcess | None:
        """The process, started if there is none; None: it is over."""
        with self.lock:
            if self.process is None and not self.over:
                self.errors.seek(0)
                self.errors.truncate()
                # where BLAS has one thread, its sums do not depend on how many processors there are
                self.process = start_module(
                    "uq.processes",
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.errors, start_new_session=True,
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "TF_CPP_MIN_LOG_LEVEL": "3"},
                )  # fmt: skip
            return self.process

    def _why(self, status: int) -> str:
        if status < 0:
            return f"its process was ended by signal {-status}{' (out of memory?)' if status == -9 else ''}"
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

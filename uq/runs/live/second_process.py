"""The recording's side of the second process: starts it, and hears it on a thread, so that nothing waits for it."""

import json
import subprocess
import tempfile
import threading
from collections import deque
from collections.abc import Callable
from typing import IO, Any

from rig.child_process import start_module
from rig.exceptions import RigError, on_one_line

PATIENCE = 5.0
"""Seconds that the process may take to end."""
PERIOD = 10.0
"""Seconds of motion between two lines where there is no terminal, at first; later a tenth more each time."""


class SecondProcess:
    """Reads the growing file and estimates; the recording only looks at what it has last said.

    Attributes:
        block: lines of the last estimate.
        messages: lines to print once, in their order.
        target_reached: whether the estimate has reached the target.
    """

    def __init__(self, rig: str, experiment: str, run: str, target: float | None, reached: Callable[[], None]) -> None:
        """Start it and wait until it is ready, before anything is recorded.

        Args:
            rig: the rig file.
            experiment: the experiment file.
            run: the file that the recording will grow in.
            target: half the interval of 95 % that every component is to have at most [kg·m²]; None: none.
            reached: called when it is.

        Raises:
            RigError: rig and experiment do not fit together, or the process does not start.
        """
        self.block: list[str] = []
        self.messages: deque[str] = deque()
        self._end, self.target_reached, self._over, self._line, self._next = reached, False, False, "", 0.0
        given = [] if target is None else [f"--target={target!r}"]
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed by close
        self._process = start_module(
            "uq.runs.live", *given, "--", rig, experiment, run,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, start_new_session=True,
        )  # fmt: skip
        self._thread = threading.Thread(target=self._listen, name="estimates", daemon=True)
        first = self._heard()
        if "ready" not in first:
            self.close()
            raise RigError(str(first.get("refused", "the process for --identify did not start")))
        self._thread.start()

    @property
    def pid(self) -> int:
        """Number of the second process."""
        return self._process.pid

    def line(self) -> str:
        """Return the last estimate in one line, not too often; empty: nothing new."""
        line, self._line = self._line, ""
        return line

    def _heard(self) -> dict[str, Any]:
        """The next message; empty: it has ended."""
        line = self._pipes()[1].readline()
        return json.loads(line) if line.endswith(b"\n") else {}

    def _pipes(self) -> tuple[IO[bytes], IO[bytes]]:
        """Standard input and output of the second process."""
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None  # noqa: S101 - it was started so
        assert stdout is not None  # noqa: S101
        return stdin, stdout

    def _listen(self) -> None:
        while message := self._heard():
            self.block = message["block"]
            if message["seconds"] >= self._next:
                self._line, self._next = message["line"], max(message["seconds"] + PERIOD, 1.1 * message["seconds"])
            if message["reached"] and not self._over:
                self._over = self.target_reached = True
                self.messages.append(f"{message['line']}: the recording ends")
                self._end()
        if not self._over:
            self.block = []
            self.messages.append(f"warning: {self._why()}; the recording goes on without an estimate")

    def _why(self) -> str:
        """Return the last message of the second process, where it has failed."""
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").strip().splitlines()
        return f"the process that identifies has ended ({on_one_line(lines[-1]) if lines else 'killed'})"

    def close(self) -> None:
        """End the second process by ending its standard input."""
        self._over = True
        stdin, stdout = self._pipes()
        stdin.close()
        try:
            self._process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._thread.is_alive():
            self._thread.join()
        stdout.close()
        self._errors.close()

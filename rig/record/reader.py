"""Reader threads, one a device: open the port, let the device introduce itself, stamp and queue what arrives."""

import threading
import time
from collections import deque
from contextlib import closing, suppress
from typing import NamedTuple

from rig.devices.conversation import Identity, NoAnswerError
from rig.exceptions import RigError
from rig.record.port import Port, PortLostError, converse, open_port
from rig.record.rig_file import DeviceEntry

LIMIT = 8 * 2**20  # bytes that may wait for the writer, per device
WAITED = 200_000  # ns that a read takes, at least, if nothing was there yet
PAUSE = 0.2  # seconds between attempts to find a lost port again


class Event(NamedTuple):
    """An event of a device: bytes, or that its port was lost or found again (then with who answered)."""

    time: int
    data: bytes = b""
    lost: bool = False
    answered: Identity | None = None


class Reader(threading.Thread):
    """Reads one device until stopped. ``failure`` is what ended it otherwise; ``identity`` is set when it is ready.

    ``caught_up`` is set when what waited in the port at its opening has been read.
    """

    def __init__(self, entry: DeviceEntry, port_name: str) -> None:
        super().__init__(name=f"reader of {entry.name}", daemon=True)
        self.entry = entry
        self.events: deque[Event] = deque()
        self.identity: Identity | None = None
        self.failure: Exception | None = None
        self.overflow = 0
        self.caught_up = False
        self._port_name = port_name
        self._halt = threading.Event()
        self._pushed = 0
        self.taken = 0  # bytes; only the writer changes it

    def halt(self) -> None:
        """Ask the thread to end: the device is told to stop, the port given back."""
        self._halt.set()

    def run(self) -> None:
        """Read until halted. An exception never goes unnoticed: it is kept in ``failure``."""
        try:
            port = self._connect()
            while not self._halt.is_set():
                try:
                    self._listen(port)
                except PortLostError:
                    port.close()
                    self.events.append(Event(time.monotonic_ns(), lost=True))
                    port = self._find_again() or port
            self._stop_device(port)
        except Exception as error:  # handed to the writer, which raises it
            self.failure = error

    def _connect(self) -> Port:
        port = open_port(self._port_name, self.entry.baudrate, self.entry.device.NUMBER)
        try:
            self.identity = converse(self.entry.device.start(), port)
        except (PortLostError, NoAnswerError) as error:
            port.close()
            raise self._reason(error) from error
        except BaseException:
            port.close()
            raise
        return port

    def _reason(self, error: PortLostError | NoAnswerError) -> RigError:
        """Return the probable reason why a device did not introduce itself, and what to do."""
        name, port, kind = self.entry.name, self._port_name, self.entry.device.kind
        if isinstance(error, PortLostError):
            return RigError(f"port lost {port} ({error}): check the cable and the power of {name}")
        if error.heard:
            return RigError(f"no valid data in the {error.heard} bytes of {name} on {port}: {self.entry.wrong_device}")
        return RigError(f"no answer from {name} on {port}: check its power and cable, and that it is a '{kind}'")

    def _listen(self, port: Port) -> None:
        while not self._halt.is_set():
            before = time.monotonic_ns()
            data = port.read()
            now = time.monotonic_ns()
            self.caught_up |= now - before > WAITED
            if not data:
                continue
            if self._pushed - self.taken > LIMIT:
                self.overflow += len(data)
                continue
            self._pushed += len(data)
            self.events.append(Event(now, data))

    def _find_again(self) -> Port | None:
        while not self._halt.wait(PAUSE):
            try:
                port = self._connect()
            except RigError:
                continue
            self.events.append(Event(time.monotonic_ns(), answered=self.identity))
            return port
        return None

    def _stop_device(self, port: Port) -> None:
        with closing(port), suppress(PortLostError):
            port.write(self.entry.device.stop())

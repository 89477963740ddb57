"""Samples and estimate for a viewer, Foxglove, over a WebSocket on this machine.

Messages are passed on as they were written, so that every topic shows in its own type; the estimate is a JSON topic. A
viewer that is slow or absent loses messages and holds up nobody.

The server checks neither host nor origin: a gate before it lets only this machine's programs and pages pass. A page
from anywhere, shown by a browser on this machine, may open a WebSocket to it. The browser says by ``Origin`` whose page
that is, and by ``Host`` which name it has looked up: perhaps a stranger's that leads here (DNS rebinding).
"""

import contextlib
import ipaddress
import secrets
import socket
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from mcap.records import Channel, Schema

from identify.rigid_body.inertia import COMPONENTS
from rig.exceptions import RigError
from uq.live.live_estimate import LiveEstimate

TOPIC = "/estimate"
BACKLOG = 2**14
"""Messages that wait for a viewer, at most."""
NUMBER = {"type": "number"}
FIGURES = ("value", "standard_uncertainty", "low", "high")
SCHEMA: dict[str, Any] = {
    "title": "inertia_uq.Estimate",
    "type": "object",
    "description": "inertia tensor about the centre of gravity, body frame, kg m^2; low and high: interval of 95 %",
    "properties": {
        "seconds": NUMBER | {"description": "of motion"},
        "text": {"type": "string"},
        **{name: {"type": "object", "properties": dict.fromkeys(FIGURES, NUMBER)} for name in COMPONENTS},
    },
}


class Viewer:
    """A server for viewers.

    Attributes:
        address: where to connect to.
    """

    def __init__(self, port: int) -> None:
        """Listen on a port of this machine; 0: on any that is free.

        Raises:
            RigError: foxglove-sdk is missing, or the port is taken.
        """
        try:
            import foxglove
        except ModuleNotFoundError:
            raise RigError("--live needs foxglove-sdk: `pip install inertia-uq[live]` installs it") from None
        self._foxglove, self._context = foxglove, foxglove.Context()
        try:
            host = hidden_address()
            self._server = self._started(host)
        except (RuntimeError, OSError):  # of 127.0.0.0/8 the system has 127.0.0.1 alone
            host = "127.0.0.1"
            self._server = self._started(host)
        try:
            self._gate = LoopbackGate(port, (host, self._server.port))
        except OSError as error:
            self._server.stop()
            raise RigError(f"--live cannot listen on port {port} ({error}): name another, or 0 for any") from None
        self.address = f"ws://127.0.0.1:{self._gate.port}"
        self._channels: dict[int, Any] = {}
        self._estimates = foxglove.Channel(TOPIC, schema=SCHEMA, context=self._context)
        self._last = 0

    def _started(self, host: str) -> Any:
        """The server, on any free port of an address that the gate alone knows."""
        return self._foxglove.start_server(
            name="inertia record", host=host, port=0, context=self._context, message_backlog_size=BACKLOG
        )

    def pass_on(self, channel: Channel, schema: Schema, log_time: int, data: bytes) -> None:
        """Send a message as it was written."""
        if channel.id not in self._channels:
            described = self._foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
            self._channels[channel.id] = self._foxglove.Channel(
                channel.topic, message_encoding=channel.message_encoding, schema=described, context=self._context
            )
        self._channels[channel.id].log(data, log_time=log_time)
        self._last = max(self._last, log_time)

    def show(self, estimate: LiveEstimate, text: str) -> None:
        """Send an estimate, at the time of the last message."""
        message: dict[str, Any] = {"seconds": estimate.seconds, "text": text}
        if not estimate.undetermined:
            rows = zip(estimate.inertia, estimate.standard_uncertainty, *estimate.interval95.T, strict=True)
            for name, row in zip(COMPONENTS, rows, strict=True):
                message[name] = dict(zip(FIGURES, map(float, row), strict=True))
        self._estimates.log(message, log_time=self._last)


NAMES = {"localhost", "127.0.0.1", "::1"}
APP = {"https://app.foxglove.dev", "file://"}
"""Foxglove in a browser, at the address that its SDK opens, and what desktop programs read from a file."""
HEAD = 2**14
"""Most bytes of a request."""
PATIENCE = 5.0
"""Seconds that a request may take."""
MOST = 16
"""Connections at once."""
REFUSAL = b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


def hidden_address() -> str:
    """Return an address of this machine that no page can guess; not every system answers at it, such as macOS."""
    return str(ipaddress.IPv4Address("127.0.0.0") + 1 + secrets.randbelow(2**24 - 2))


def permitted(head: bytes) -> bool:
    """Whether a request is for a WebSocket of this machine, from a program, a page of this machine, or Foxglove."""
    pairs = [line.partition(":") for line in head.decode("latin-1").split("\r\n")[1:]]
    values: dict[str, list[str]] = {"host": [], "origin": [], "upgrade": []}
    for name, _, text in pairs:
        values.get(name.lower(), []).append(text.strip())
    try:
        hosts = [urlsplit(f"//{host}").hostname for host in values["host"]]
        pages = [urlsplit(origin).hostname for origin in values["origin"] if origin not in APP]
    except ValueError:
        return False
    upgrade = [text.lower() for text in values["upgrade"]]
    return upgrade == ["websocket"] and len(hosts) == 1 and NAMES.issuperset(hosts) and NAMES.issuperset(pages)


class LoopbackGate:
    """Listens on a port of 127.0.0.1 and hands on what is permitted.

    Attributes:
        port: where it listens.
    """

    def __init__(self, port: int, server: tuple[str, int]) -> None:
        """Listen (0: on any port that is free) before a server.

        Raises:
            OSError: the port is taken.
        """
        self._listening, self._server = socket.create_server(("127.0.0.1", port)), server
        self.port: int = self._listening.getsockname()[1]
        self._free = threading.Semaphore(MOST)
        threading.Thread(target=self._accept, name="viewers", daemon=True).start()

    def _accept(self) -> None:
        while True:
            with contextlib.suppress(OSError):  # who came has gone
                client = self._listening.accept()[0]
                threading.Thread(target=self._serve, args=(client,), name="viewer", daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError):
            if not self._free.acquire(blocking=False):
                return
            try:
                self._hand_on(client)
            finally:
                self._free.release()

    def _hand_on(self, client: socket.socket) -> None:
        end = time.monotonic() + PATIENCE
        head = b""
        while b"\r\n\r\n" not in head:
            if (remaining := end - time.monotonic()) <= 0:
                return
            client.settimeout(remaining)
            data = client.recv(HEAD)
            head += data
            if not data or len(head) > HEAD:
                return
        if not permitted(head.partition(b"\r\n\r\n")[0]):
            client.sendall(REFUSAL)
            return
        with socket.create_connection(self._server, PATIENCE) as server:
            server.sendall(head)
            for ours in (client, server):
                ours.settimeout(None)
            back = threading.Thread(target=_pump, args=(server, client), name="viewer", daemon=True)
            back.start()
            _pump(client, server)
            back.join()


def _pump(source: socket.socket, sink: socket.socket) -> None:
    """Hand on bytes until either end has closed, which then ends the other direction, too."""
    with contextlib.suppress(OSError):
        while data := source.recv(2**16):
            sink.sendall(data)
    for end in (source, sink):
        with contextlib.suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)

"""A gate before the viewer's server, which checks neither host nor origin: only this machine's programs and pages pass.

A page from anywhere, shown by a browser on this machine, may open a WebSocket to it. The browser says by ``Origin``
whose page that is, and by ``Host`` which name it has looked up: perhaps a stranger's that leads here (DNS rebinding).
"""

import contextlib
import ipaddress
import secrets
import socket
import threading
from urllib.parse import urlsplit

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
        client.settimeout(PATIENCE)
        head = b""
        while b"\r\n\r\n" not in head:
            data = client.recv(HEAD)
            head += data
            if not data or len(head) > HEAD:
                return
        if not permitted(head.partition(b"\r\n\r\n")[0]):
            client.sendall(REFUSAL)
            return
        with socket.create_connection(self._server, PATIENCE) as server:
            server.sendall(head)
            for end in (client, server):
                end.settimeout(None)
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

"""The emulated end of a line: a pseudo-terminal, a UDP socket or a TCP socket; other ports of a network device."""

import contextlib
import os
import select
import socket
from collections.abc import Callable
from pathlib import Path

HOST = "127.0.0.1"
LARGEST = 65536
PATIENCE = 0.2  # seconds that a question on another port may take to arrive


class Pty:
    """One pseudo-terminal under a path that survives unplugging."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.port = str(link)
        self.master = -1
        self.plug()

    @property
    def present(self) -> bool:
        """Whether the device is plugged in."""
        return self.master >= 0

    def plug(self) -> None:
        """Make the terminal and its path."""
        import tty

        self.master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        with contextlib.suppress(FileNotFoundError):
            self.link.unlink()
        self.link.symlink_to(os.ttyname(slave))
        os.close(slave)

    def unplug(self) -> None:
        """Take both away."""
        self.link.unlink()
        os.close(self.master)
        self.master = -1

    def forget(self) -> None:
        """Discard what the last reader left unread, as a serial line does when it is closed."""
        import termios

        slave = os.open(self.link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        termios.tcflush(slave, termios.TCIFLUSH)
        os.close(slave)

    @property
    def opened(self) -> bool:
        """Whether somebody has the terminal open."""
        if self.master < 0:
            return False
        poll = select.poll()
        poll.register(self.master, select.POLLIN)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def read(self) -> bytes:
        """Return the bytes that were sent to the device."""
        try:
            return os.read(self.master, 4096)
        except OSError:
            return b""

    def write(self, data: bytes) -> int:
        """Send what the terminal takes; returns how much that was."""
        try:
            return os.write(self.master, data)
        except OSError:
            return 0


class SocketEndpoint:
    """A socket whose number stays the same when it is plugged in again; what nobody reads of it is gone anyway."""

    _socket: socket.socket
    """The socket that is open while the device is plugged in."""
    _number = 0

    @property
    def present(self) -> bool:
        """Whether the device is plugged in."""
        return self._socket.fileno() >= 0

    def forget(self) -> None:
        """Do nothing: what the last reader left unread has gone with the connection."""


class UdpEndpoint(SocketEndpoint):
    """A socket that sends datagrams of ``size`` bytes to whoever asked last.

    ``lose`` and ``swap`` disturb the network: every so many datagrams after the last command one is lost, or comes
    after its successor; 0 is never.
    """

    def __init__(self, size: int, *, lose: int = 0, swap: int = 0) -> None:
        self._size, self._lose, self._swap = size, lose, swap
        self._count, self._late = 0, b""
        self._peer: tuple[str, int] | None = None
        self.plug()

    @property
    def opened(self) -> bool:
        """Whether somebody has sent the endpoint anything."""
        if self._peer is None:
            with contextlib.suppress(OSError):
                self._peer = self._socket.recvfrom(LARGEST, socket.MSG_PEEK)[1]
        return self._peer is not None

    def plug(self) -> None:
        """Make the socket, under the same number as before."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind((HOST, self._number))
        self._number = self._socket.getsockname()[1]
        self.port = f"udp://{HOST}:{self._number}"

    def unplug(self) -> None:
        """Take it away."""
        self._socket.close()
        self._peer = None

    def read(self) -> bytes:
        """The last command."""
        with contextlib.suppress(OSError):
            data, self._peer = self._socket.recvfrom(LARGEST)
            self._count = 0
            return data
        return b""

    def write(self, data: bytes) -> int:
        """Send every datagram, or lose it on the way."""
        if self._peer is None:
            return 0
        for start in range(0, len(data), self._size):
            self._count += 1
            datagram = data[start : start + self._size]
            if self._lose and self._count % self._lose == 0:
                continue
            if self._swap and self._count % self._swap == 0:
                self._late = datagram
                continue
            for sent in filter(None, (datagram, self._late)):
                with contextlib.suppress(OSError):
                    self._socket.sendto(sent, self._peer)
            self._late = b""
        return len(data)


class TcpEndpoint(SocketEndpoint):
    """A listening socket with at most one client."""

    def __init__(self) -> None:
        self._client = socket.socket()  # of nobody yet
        self._client.close()
        self.plug()

    @property
    def opened(self) -> bool:
        """Whether the endpoint has a client."""
        if self._client.fileno() < 0:
            with contextlib.suppress(OSError):
                self._client = self._socket.accept()[0]
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._client.fileno() >= 0

    def plug(self) -> None:
        """Listen, under the same number as before."""
        self._socket = socket.create_server((HOST, self._number))
        self._socket.setblocking(False)
        self._number = self._socket.getsockname()[1]
        self.port = f"tcp://{HOST}:{self._number}"

    def unplug(self) -> None:
        """Take it away."""
        self._client.close()
        self._socket.close()

    def read(self) -> bytes:
        """Return the bytes that were sent to the device; notices that the client has gone."""
        try:
            data = self._client.recv(LARGEST)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._client.close()
        return data

    def write(self, data: bytes) -> int:
        """Send what the connection takes."""
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._client.close()
            return 0


Endpoint = Pty | UdpEndpoint | TcpEndpoint
"""The device's end of a line that can be unplugged."""


class OtherPort:
    """A further TCP port of a network device: one question a connection."""

    def __init__(self, number: int, answer: Callable[[int, bytes], bytes]) -> None:
        self._stands_for, self._answer = number, answer
        self._listener = socket.create_server((HOST, 0))
        self._listener.setblocking(False)
        self.number: int = self._listener.getsockname()[1]

    def attend(self) -> None:
        """Answer whoever has asked."""
        with contextlib.suppress(OSError):
            client = self._listener.accept()[0]
            with client:
                client.settimeout(PATIENCE)
                client.sendall(self._answer(self._stands_for, client.recv(LARGEST)))

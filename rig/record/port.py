"""Ports: serial lines through pyserial, UDP, TCP. Blocking reads with a time-out; every failure in one clear line."""

import errno
import os
import select
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Protocol, runtime_checkable
from urllib.parse import parse_qsl, urlsplit

import serial

from rig.devices.conversation import Conversation, Identity, Inquire, Send
from rig.exceptions import RigError, quoted

TIMEOUT = 0.1  # seconds that a read may wait
LARGEST_READ = 65536
LARGEST_ANSWER = 2**20  # bytes of an answer on another port
QUIET = 2.0  # seconds without a byte after which a device on the network is asked anew: a restart forgets its clients
PATIENCE = 2.0  # seconds to connect, and to answer on another port
BUFFER = 2**20  # bytes that the system keeps for us while we are busy
SAID = {"PermissionError": errno.EBUSY, "FileNotFoundError": errno.ENOENT}


class PortLostError(Exception):
    """The port has gone: unplugged, or closed at the other end."""


@runtime_checkable
class Port(Protocol):
    """A stream of bytes with somebody at the other end."""

    def read(self) -> bytes:
        """Return the bytes that have arrived; waits up to TIMEOUT for the first byte. Raises PortLostError."""

    def write(self, data: bytes) -> None:
        """Send these bytes. Raises PortLostError."""

    def close(self) -> None:
        """Give the port back."""


class _Line(serial.Serial):
    """A serial line that keeps what arrives while it is being opened: a sensor that boots then says who it is."""

    def _reset_input_buffer(self) -> None:
        """Keep the buffer that pyserial would empty: it holds nothing older for a line nobody had open."""


class SerialPort:
    """A serial line, exclusively ours, raw, 8N1."""

    def __init__(self, path: str, baudrate: int) -> None:
        try:
            self._port = _Line(path, baudrate, timeout=TIMEOUT, write_timeout=1.0, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise _reason(path, baudrate, error) from error
        self._has_descriptor = hasattr(self._port, "fd")  # not on Windows

    def read(self) -> bytes:
        """Return the bytes that have arrived within TIMEOUT. Straight from the descriptor: one call a frame."""
        try:
            if not self._has_descriptor:
                return self._port.read(max(1, self._port.in_waiting))
            if not select.select([self._port.fd], [], [], TIMEOUT)[0]:  # macOS cannot poll() a device
                return b""
            data = os.read(self._port.fd, LARGEST_READ)
        except (OSError, TypeError, ValueError) as error:  # closed under the read
            raise PortLostError(str(error)) from error
        if not data:  # readable and empty: the other end has gone
            raise PortLostError("end of input")
        return data

    def write(self, data: bytes) -> None:
        """Send these bytes."""
        try:
            self._port.write(data)
        except (serial.SerialException, OSError) as error:
            raise PortLostError(str(error)) from error

    def close(self) -> None:
        """Give the port back."""
        self._port.close()


class _SocketPort:
    """A port behind a socket."""

    _socket: socket.socket

    def _receive(self) -> bytes | None:
        """Return the bytes that have come, or None where none do within TIMEOUT."""
        try:
            return self._socket.recv(LARGEST_READ)
        except TimeoutError:
            return None
        except OSError as error:
            raise PortLostError(_said(error)) from error

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


class UdpPort(_SocketPort):
    """Datagrams that arrive at a local port; each is made to end in a line end."""

    def __init__(self, number: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(TIMEOUT)
        try:
            self._socket.bind(("", number))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise RigError(f"cannot listen on UDP port {number}: choose a free one from 1024 to 65535") from error

    def read(self) -> bytes:
        """The next datagram."""
        data = self._receive()
        return b"" if data is None else data.removesuffix(b"\n") + b"\n"

    def write(self, data: bytes) -> None:
        """There is nobody to answer."""


class Address(NamedTuple):
    """The address of a device on the network: ``udp://HOST``, ``tcp://HOST:NUMBER``, ``udp://HOST:NUMBER?80=8080``.

    ``others`` are numbers that stand for the device's other ports, behind a gateway or for an emulated device.
    """

    scheme: str
    host: str
    number: int
    others: dict[int, int]

    @classmethod
    def of(cls, name: str, number: int = 0) -> "Address":
        """Read an address; ``number`` where it names none. Raises ValueError."""
        parts = urlsplit(name)
        others = {int(key): int(value) for key, value in parse_qsl(parts.query, strict_parsing=bool(parts.query))}
        address = cls(parts.scheme, parts.hostname or "", parts.port or number, others)
        if not (address.host and address.number) or parts.path or parts.fragment or parts.username:
            raise ValueError(name)
        return address


class NetworkPort(_SocketPort):
    """A device on the network, by UDP (a read is one datagram) or TCP."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._name = f"{address.scheme}://{address.host}:{address.number}"
        kind = socket.SOCK_DGRAM if address.scheme == "udp" else socket.SOCK_STREAM
        try:
            family, *_, where = socket.getaddrinfo(address.host, address.number, type=kind)[0]
        except (OSError, UnicodeError) as error:
            raise RigError(f"no address {address.host} on the network: correct `port`, or write its number") from error
        self._socket = socket.socket(family, kind)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        self._socket.settimeout(PATIENCE)
        try:
            self._socket.connect(where)
        except OSError as error:
            self._socket.close()
            raise RigError(f"no connection to {self._name} ({_said(error)}): check address, power and cable") from error
        self._socket.settimeout(TIMEOUT)
        self._quiet = 0.0

    def read(self) -> bytes:
        """Return what has arrived: one datagram, or the bytes of the connection."""
        data = self._receive()
        self._quiet = self._quiet + TIMEOUT if data is None else 0.0
        if self._quiet > QUIET:
            raise PortLostError(f"nothing for {QUIET:g} s")
        if data == b"" and self._address.scheme == "tcp":
            raise PortLostError("it hung up")
        return data or b""

    def write(self, data: bytes) -> None:
        """Send, over UDP as one datagram."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise PortLostError(_said(error)) from error

    def inquire(self, number: int, data: bytes) -> bytes:
        """The answer of the device's other TCP port ``number``, until that side closes; empty where there is none."""
        answer = b""
        where = (self._address.host, self._address.others.get(number, number))
        try:
            with socket.create_connection(where, PATIENCE) as other:
                other.sendall(data)
                while (more := other.recv(LARGEST_READ)) and len(answer) < LARGEST_ANSWER:
                    answer += more
        except OSError:
            return answer
        return answer


def _said(error: OSError) -> str:
    return "no answer" if isinstance(error, TimeoutError) else error.strerror or str(error)


def on_network(name: str) -> bool:
    """Whether a port's name is the address of a device on the network."""
    return name.startswith(("udp://", "tcp://"))


def open_port(name: str, baudrate: int, number: int = 0) -> Port:
    """Open a serial port (``/dev/...``, ``COM3``), ``udp:NUMBER``, ``udp://HOST`` or ``tcp://HOST``.

    ``number`` is the port of a device on the network whose address names none.

    Raises:
        RigError: it cannot be opened; the line says what to do.
    """
    if on_network(name):
        try:
            address = Address.of(name, number)
        except ValueError as error:
            raise RigError(f"{quoted(name)} is no address: write udp://ADDRESS or tcp://ADDRESS:NUMBER") from error
        return NetworkPort(address)
    if name.startswith("udp:"):
        return UdpPort(int(name[4:]))
    return SerialPort(name, baudrate)


def _reason(path: str, baudrate: int, error: Exception) -> RigError:
    code = getattr(error, "errno", None)
    if code is None:  # on Windows pyserial only says what Python raised
        code = next((number for name, number in SAID.items() if name in str(error)), None)
    if code == errno.EACCES:
        return RigError(f"no permission for port {path}: add yourself to its group (often 'dialout') and log in again")
    if code in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or "lock" in str(error):
        return RigError(f"port busy {path}: end the other program that uses it")
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        return RigError(f"no port {path}: plug the device in, `inertia record --list` shows what is there")
    if isinstance(error, ValueError):
        return RigError(f"baud rate {baudrate} is not possible on port {path}: choose another `baudrate`")
    text = str(error) if code is None else os.strerror(code)
    return RigError(f"cannot open port {path} ({text}): is it a serial port?")


def latency_file(path: str) -> Path:
    """Return the file in which Linux keeps the latency timer of a USB adapter."""
    return Path("/sys/class/tty") / Path(os.path.realpath(path)).name / "device" / "latency_timer"


def latency_warning(path: str) -> str:
    """Set a USB adapter's latency timer to 1 ms where we may; returns a warning where it stays longer, else ''."""
    timer = latency_file(path)
    try:
        if int(timer.read_text()) > 1:
            with suppress(OSError):
                timer.write_text("1")
        value = int(timer.read_text())
    except (OSError, ValueError):
        return ""
    return f"latency timer of {path} is {value} ms: write 1 to {timer} for better time stamps" if value > 1 else ""


def converse(conversation: Conversation, port: Port) -> Identity:
    """Let a device's conversation talk through a port until it has come to its end.

    Raises:
        NoAnswerError, RigError: from the conversation.
        PortLostError: from the port.
    """
    answer: tuple[bytes, float] | None = None
    while True:
        try:
            request = conversation.send(answer) if answer else next(conversation)
        except StopIteration as stop:
            return stop.value
        if isinstance(request, Send):
            port.write(request.data)
            answer = None
        elif isinstance(request, Inquire):
            start = time.monotonic()
            heard = port.inquire(*request) if isinstance(port, NetworkPort) else b""
            answer = heard, time.monotonic() - start
        else:
            start = time.monotonic()
            answer = port.read(), time.monotonic() - start

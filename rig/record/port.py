"""Ports: serial lines through pyserial, and UDP. Blocking reads with a time-out; every failure in one clear line."""

import errno
import os
import select
import socket
import time
from pathlib import Path
from typing import Protocol, runtime_checkable

import serial

from rig.devices.conversation import Conversation, Identity, Send
from rig.exceptions import RigError

TIMEOUT = 0.1  # seconds that a read may wait
LARGEST_READ = 65536
SAID = {"PermissionError": errno.EBUSY, "FileNotFoundError": errno.ENOENT}


class PortLostError(Exception):
    """The port has gone: unplugged, or closed at the other end."""


@runtime_checkable
class Port(Protocol):
    """A stream of bytes with somebody at the other end."""

    def read(self) -> bytes:
        """What has arrived; waits up to TIMEOUT for the first byte. Raises PortLostError."""

    def write(self, data: bytes) -> None:
        """Send. Raises PortLostError."""

    def close(self) -> None:
        """Give the port back."""


class _Line(serial.Serial):
    """A serial line that keeps what arrives while it is being opened: a sensor that boots then says who it is."""

    def _reset_input_buffer(self) -> None:
        """Not at the opening, where pyserial does so: the system holds nothing older for a line nobody had open."""


class SerialPort:
    """A serial line, exclusively ours, raw, 8N1."""

    def __init__(self, path: str, baudrate: int) -> None:
        try:
            self._port = _Line(path, baudrate, timeout=TIMEOUT, write_timeout=1.0, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise _reason(path, baudrate, error) from error
        self._has_descriptor = hasattr(self._port, "fd")  # not on Windows

    def read(self) -> bytes:
        """What has arrived; waits up to TIMEOUT for the first byte. Straight from the descriptor: one call a frame."""
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
        """Send."""
        try:
            self._port.write(data)
        except (serial.SerialException, OSError) as error:
            raise PortLostError(str(error)) from error

    def close(self) -> None:
        """Give the port back."""
        self._port.close()


class UdpPort:
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
        try:
            data = self._socket.recv(LARGEST_READ)
        except TimeoutError:
            return b""
        except OSError as error:
            raise PortLostError(str(error)) from error
        return data if data.endswith(b"\n") else data + b"\n"

    def write(self, data: bytes) -> None:
        """There is nobody to answer."""

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def open_port(name: str, baudrate: int) -> Port:
    """Open a serial port (``/dev/...``, ``COM3``) or ``udp:NUMBER``.

    Raises:
        RigError: it cannot be opened; the line says what to do.
    """
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
    return RigError(f"cannot open port {path} ({error}): is it a serial port?")


def latency_file(path: str) -> Path:
    """Where Linux keeps the latency timer of a USB adapter."""
    return Path("/sys/class/tty") / Path(os.path.realpath(path)).name / "device" / "latency_timer"


def latency_warning(path: str) -> str:
    """Set a USB adapter's latency timer to 1 ms where we may; returns a warning where it stays longer, else ''."""
    timer = latency_file(path)
    try:
        value = int(timer.read_text())
        if value > 1:
            timer.write_text("1")
        value = int(timer.read_text())
    except (OSError, ValueError):
        value = int(timer.read_text()) if timer.is_file() else 1
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
        else:
            start = time.monotonic()
            answer = port.read(), time.monotonic() - start

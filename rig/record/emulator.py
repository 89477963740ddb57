"""Emulated sensors on pseudo-terminals, playing a recorded or simulated run: the whole path without hardware.

Runs as a process of its own, ``python -m rig.record.emulator``, so that it takes no time from the recorder. It reads a
list of devices as one line of JSON, answers with one line that tells their ports, and then obeys one command a line:

    go               the run starts shortly, the answer tells when; until then the sensors show its first sample
    unplug NAME      the port vanishes;  ``plug NAME`` brings it back under the same path
    silence NAME     no more bytes;      ``babble NAME``: random bytes instead of frames;  ``heal NAME``: frames again
    quit             the end, as is the end of its input
"""

import contextlib
import json
import math
import os
import select
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import Recording
from rig.devices import create_device
from rig.devices.line import IMU, WRENCH
from rig.exceptions import RigError
from rig.runs import read

BACKLOG = 2**20  # bytes that wait for a slow reader before they are dropped, as in an adapter with much memory


class Signals:
    """What the sensors of an experiment show, by linear interpolation between the samples of a run.

    ``time`` (n,) [s] from 0, ``values`` (n, 12): wrench on the body [N, N·m], angular velocity [rad/s], specific force
    [m/s²].
    """

    NAMES = WRENCH + IMU

    def __init__(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        self.time, self.values = time, values

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @classmethod
    def of(cls, run: Recording) -> "Signals":
        """The signals of a recorded run, by header stamps, from the first to the last time that both channels cover."""
        start = max(run.wrench.stamp[0], run.imu.stamp[0])
        t_wrench, t_imu = ((channel.stamp - start) * 1e-9 for channel in (run.wrench, run.imu))
        wrench = np.concatenate([run.wrench.force, run.wrench.moment], axis=1)
        imu = np.concatenate([run.imu.angular_velocity, run.imu.linear_acceleration], axis=1)
        time = t_imu if len(t_imu) >= len(t_wrench) else t_wrench
        time = time[(time >= 0) & (time <= min(t_wrench[-1], t_imu[-1]))]
        columns = [np.interp(time, t_wrench, column) for column in wrench.T]
        columns += [np.interp(time, t_imu, column) for column in imu.T]
        return cls(time, np.stack(columns, axis=1))

    def sample(self, times: NDArray[np.float64], names: tuple[str, ...], matrix: NDArray[np.float64]) -> NDArray:
        """The named values at ``times`` (m,) as the sensor reads them, (m, len(names)); ``matrix``: sensor to body."""
        columns = {name: np.interp(times, self.time, self.values[:, i]) for i, name in enumerate(self.NAMES)}
        chosen = np.stack([columns.get(name, np.zeros(len(times))) for name in names], axis=1)
        if names in (WRENCH, IMU):
            return np.concatenate([chosen[:, :3] @ matrix, chosen[:, 3:] @ matrix], axis=1)
        return chosen


class Pty:
    """One pseudo-terminal under a path that survives unplugging."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.master = -1
        self.plug()

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
        """What was sent to the device."""
        try:
            return os.read(self.master, 4096)
        except (BlockingIOError, OSError):
            return b""

    def write(self, data: bytes) -> int:
        """Send what the terminal takes; returns how much that was."""
        try:
            return os.write(self.master, data)
        except (BlockingIOError, OSError):
            return 0


class Line:
    """One emulated device on its terminal. Sample k is due ``k / rate`` after ``zero``, which all devices share."""

    BATCH = 2000

    def __init__(self, spec: dict, signals: Signals, folder: Path, zero: float) -> None:
        self._device = create_device(spec["kind"], **spec["options"])
        self._signals = signals
        self._matrix = np.array(spec["matrix"])
        self._delay, self._skew = spec.get("delay", 0.0), 1 + 1e-6 * spec.get("skew_ppm", 0.0)
        self._loop = bool(spec.get("loop"))
        self._wire = self._device.FRAME_BYTES * 10 / spec["baudrate"]
        names = getattr(self._device, "names", None)
        self._names = names or (WRENCH if self._device.measures == "wrench" else IMU)
        self.pty = Pty(folder / spec["name"])
        self._emulator = self._device.emulator(rate=spec.get("rate") or self._device.rate or 100.0)
        self._zero, self._start = zero, float("inf")
        self.behaviour = "heal"
        self._opened, self._next_look = False, 0.0
        self._backlog = bytearray()
        self._random = np.random.default_rng(1)
        self._set_rate(zero)

    def _set_rate(self, now: float) -> None:
        self._rate = self._emulator.rate
        self._index = math.ceil((now - self._zero) * self._rate)
        self._block, self._block_start = np.zeros((0, 0)), 0

    def go(self, start: float) -> None:
        """The run starts at this time."""
        self._start = start
        self._block = np.zeros((0, 0))

    @property
    def due(self) -> float:
        """When the next frame has come down the wire, by the host's clock."""
        return self._zero + self._index / self._rate + self._wire

    def step(self, now: float) -> None:
        """Do what is due."""
        if now >= self._next_look:
            self._next_look = now + 0.005
            self._attend(now)
        sending = bytearray()
        while self.due <= now and len(sending) < 65536:
            if self._opened and self._emulator.streaming and self._playing:
                sending += self._frame()
            self._index += 1
        if self.behaviour == "silence":
            sending.clear()
        if self.behaviour == "babble" and self._opened:
            sending = bytearray(self._random.bytes(2000))
        self._send(sending)

    @property
    def _playing(self) -> bool:
        """Frames flow before the start is known and while the run lasts, so that nothing but the run is recorded."""
        time = self._zero + self._index / self._rate - self._start
        return math.isinf(time) or (time > -1e-9 and (self._loop or time < self._signals.duration + 1e-9))

    def _frame(self) -> bytes:
        offset = self._index - self._block_start
        if not 0 <= offset < len(self._block):
            self._block_start, offset = self._index, 0
            self._block = self._signals.sample(self._times(), self._names, self._matrix)
        device_time = self._index / self._rate * self._skew
        return self._emulator.frame(self._index, device_time, tuple(self._block[offset].tolist()))

    def _times(self) -> NDArray[np.float64]:
        """The times within the run of the next samples."""
        if math.isinf(self._start):
            return np.zeros(self.BATCH)
        times = (self._zero - self._start - self._delay) + np.arange(self._index, self._index + self.BATCH) / self._rate
        return times % self._signals.duration if self._loop else times

    def _attend(self, now: float) -> None:
        """Notice that the port was opened or closed, and answer what was asked."""
        opened = self.pty.opened
        if opened and not self._opened:
            self._send(self._emulator.boot())
        if not opened:
            self._backlog.clear()
            if self._opened and self.pty.master >= 0:
                self.pty.forget()
            self._emulator.streaming = False
        self._opened = opened
        if opened and (data := self.pty.read()):
            self._send(self._emulator.receive(data))
        if self._emulator.rate != self._rate:
            self._set_rate(now)

    def _send(self, data: bytes | bytearray) -> None:
        if len(self._backlog) < BACKLOG:
            self._backlog += data
        if self._backlog and self.pty.master >= 0:
            del self._backlog[: self.pty.write(bytes(self._backlog))]


GRID = 0.1  # seconds; runs start on this grid, on which samples at every rate that is a multiple of 10 Hz lie


def obey(command: str, lines: dict[str, Line], zero: float) -> bool:
    """Carry out one command; False at the end."""
    verb, _, name = command.strip().partition(" ")
    if verb == "go":
        start = zero + GRID * math.ceil((time.monotonic() + 0.01 - zero) / GRID)
        for line in lines.values():
            line.go(start)
        _answer({"start": start})
    elif verb in ("silence", "babble", "heal"):
        lines[name].behaviour = verb
    elif verb == "unplug":
        lines[name].pty.unplug()
    elif verb == "plug":
        lines[name].pty.plug()
    return verb != "quit"


def _answer(facts: dict) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()


def _serve(lines: dict[str, Line], zero: float) -> None:
    stdin = sys.stdin.fileno()
    os.set_blocking(stdin, False)
    heard = b""
    while True:
        pause = min(line.due for line in lines.values()) - time.monotonic()
        if select.select([stdin], [], [], min(max(pause, 0.0), 0.002))[0]:
            data = os.read(stdin, 4096)
            *commands, heard = (heard + data).split(b"\n")
            if not data or not all(obey(c.decode(), lines, zero) for c in commands):
                return
        now = time.monotonic()
        for line in lines.values():
            line.step(now)


def _first_line() -> bytes:
    """One line of input, and not a byte more: the rest is read as commands."""
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(sys.stdin.fileno(), 1)):
        line += byte
    return line


def main() -> None:
    """Emulate the devices that the first line of the input describes."""
    specs = json.loads(_first_line())
    try:
        signals = {path: Signals.of(read(path)) for path in {spec["run"] for spec in specs}}
    except (RigError, OSError) as error:
        _answer({"error": str(error)})
        return
    zero = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="rig-emulator-") as folder:
        lines = {spec["name"]: Line(spec, signals[spec["run"]], Path(folder), zero) for spec in specs}
        duration = max(played.duration for played in signals.values())
        endless = any(spec.get("loop") for spec in specs)
        ports = {name: str(line.pty.link) for name, line in lines.items()}
        _answer({"ports": ports, "duration": None if endless else duration})
        _serve(lines, zero)


if __name__ == "__main__":
    main()

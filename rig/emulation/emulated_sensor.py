"""One emulated sensor: what it says when, on its end of the line."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.devices import create_device
from rig.devices.base import Device
from rig.emulation.endpoints import Endpoint, OtherPort, Pty, TcpEndpoint, UdpEndpoint
from rig.emulation.signals import Signals

BACKLOG = 2**20  # bytes that wait for a slow reader before they are dropped, as in an adapter with much memory


class EmulatedSensor:
    """One emulated device on its line. Sample k is due ``k / rate`` after ``zero``, which all devices share."""

    BATCH = 2000

    def __init__(self, spec: dict, signals: Signals, folder: Path, zero: float) -> None:
        self._device = create_device(spec["kind"], **spec["options"])
        self._signals = signals
        self._matrix = np.array(spec["matrix"])
        self._delay, self._skew = spec.get("delay", 0.0), 1 + 1e-6 * spec.get("skew_ppm", 0.0)
        self._loop = bool(spec.get("loop"))
        self._wire = 0.0 if self._device.NETWORK else self._device.FRAME_BYTES * 10 / spec["baudrate"]
        self._names = tuple(name for channel in self._device.channels for name in channel.signals)
        self.endpoint = _endpoint(self._device, spec, folder)
        self._emulator = self._device.emulator(rate=spec.get("rate") or self._device.rate or 100.0)
        self._others = {number: OtherPort(number, self._emulator.inquired) for number in self._device.INQUIRIES}
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
    def port(self) -> str:
        """Name of the port by which a recorder finds the sensor, with the numbers that stand for its other ports."""
        others = "&".join(f"{number}={other.number}" for number, other in self._others.items())
        return f"{self.endpoint.port}?{others}" if others else self.endpoint.port

    @property
    def due(self) -> float:
        """Time at which the next frame has arrived, by the host's clock."""
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
        for other in self._others.values():
            other.attend()
        opened = self.endpoint.opened
        if opened and not self._opened:
            self._send(self._emulator.boot())
        if not opened:
            self._backlog.clear()
            if self._opened and self.endpoint.present:
                self.endpoint.forget()
            self._emulator.streaming = False
        self._opened = opened
        if opened and (data := self.endpoint.read()):
            self._send(self._emulator.receive(data))
        if self._emulator.rate != self._rate:
            self._set_rate(now)

    def _send(self, data: bytes | bytearray) -> None:
        if len(self._backlog) < BACKLOG:
            self._backlog += data
        if self._backlog and self.endpoint.present:
            del self._backlog[: self.endpoint.write(bytes(self._backlog))]


def _endpoint(device: Device, spec: dict, folder: Path) -> Endpoint:
    if device.NETWORK == "udp":
        return UdpEndpoint(device.FRAME_BYTES, lose=round(spec.get("lose", 0)), swap=round(spec.get("swap", 0)))
    return TcpEndpoint() if device.NETWORK == "tcp" else Pty(folder / spec["name"])

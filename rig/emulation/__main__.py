"""Emulated sensors, playing a recorded or simulated run: the whole path without hardware.

Runs as a process of its own, ``python -m rig.emulation``, so that it takes no time from the recorder. It reads a
list of devices as one line of JSON, answers with one line that tells their ports, and then obeys one command a line:

    go               the run starts shortly, the answer tells when; until then the sensors show its first sample
    unplug NAME      the port vanishes;  ``plug NAME`` brings it back under the same path
    silence NAME     no more bytes;      ``babble NAME``: random bytes instead of frames;  ``heal NAME``: frames again
    quit             the end, as is the end of its input
"""

import json
import math
import os
import select
import sys
import tempfile
import time
from pathlib import Path

from rig.emulation.emulated_sensor import EmulatedSensor
from rig.emulation.signals import Signals
from rig.exceptions import RigError
from rig.runs import read_any

GRID = 0.1  # seconds; runs start on this grid, on which samples at every rate that is a multiple of 10 Hz lie


def obey(command: str, sensors: dict[str, EmulatedSensor], zero: float) -> bool:
    """Carry out one command; False at the end."""
    verb, _, name = command.strip().partition(" ")
    if verb == "go":
        start = zero + GRID * math.ceil((time.monotonic() + 0.01 - zero) / GRID)
        for sensor in sensors.values():
            sensor.go(start)
        _answer({"start": start})
    elif verb in ("silence", "babble", "heal"):
        sensors[name].behaviour = verb
    elif verb == "unplug":
        sensors[name].endpoint.unplug()
    elif verb == "plug":
        sensors[name].endpoint.plug()
    return verb != "quit"


def _answer(facts: dict) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()


def _serve(sensors: dict[str, EmulatedSensor], zero: float) -> None:
    stdin = sys.stdin.fileno()
    os.set_blocking(stdin, False)
    heard = b""
    while True:
        pause = min(sensor.due for sensor in sensors.values()) - time.monotonic()
        if select.select([stdin], [], [], min(max(pause, 0.0), 0.002))[0]:
            data = os.read(stdin, 4096)
            *commands, heard = (heard + data).split(b"\n")
            if not data or not all(obey(c.decode(), sensors, zero) for c in commands):
                return
        now = time.monotonic()
        for sensor in sensors.values():
            sensor.step(now)


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
        signals = {path: Signals.of(read_any(path)) for path in {spec["run"] for spec in specs}}
    except (RigError, OSError) as error:
        _answer({"error": str(error)})
        return
    zero = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="rig-emulator-") as folder:
        sensors = {spec["name"]: EmulatedSensor(spec, signals[spec["run"]], Path(folder), zero) for spec in specs}
        duration = max(played.duration for played in signals.values())
        endless = any(spec.get("loop") for spec in specs)
        ports = {name: sensor.port for name, sensor in sensors.items()}
        _answer({"ports": ports, "duration": None if endless else duration})
        _serve(sensors, zero)


if __name__ == "__main__":
    main()

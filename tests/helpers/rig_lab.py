"""A bench of emulated sensors in a process of their own, and the recorder in another, for the tests."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from rig.mcap import message_definitions
from rig.mcap.cdr import encoder
from rig.mcap.writer import new_writer, register
from rig.record.device_source import DeviceSource
from rig.record.reader import Reader
from rig.record.rig_file import load_rig

RIG = """
[[device]]
name = "cell"
kind = "bota"
port = "{cell}"
wrench = "on_body"
options = {{ rate = 800 }}

[[device]]
name = "imu"
kind = "xsens"
port = "{imu}"
baudrate = 921600
options = {{ rate = 400 }}
"""

LINE = """
[[device]]
name = "line"
kind = "line"
port = "/dev/none"
baudrate = 100000000
options = {{ columns = ["{first}", "level m"] }}
"""


def device_source(folder, text):
    """The one device of a rig file, without its port: bytes and arrivals to samples with stamps."""
    (folder / "rig.toml").write_text(text)
    (entry,) = load_rig(folder / "rig.toml").entries
    return DeviceSource(entry, Reader(entry, "/dev/none"), now=0)


def ramp_run(path, seconds, rate=800.0):
    """Every value grows with time, so that each sample tells when it is from: force_x = omega_x = t and so on."""
    t = np.arange(round(rate * seconds) + 1) / rate
    rows = np.stack([t, -t, 2 * t], axis=1)
    time_ = 10**9 + np.round(t * 1e9).astype(np.int64)
    wrench = WrenchChannel("/wrench", "body", time_, time_, rows, rows[:, ::-1].copy())
    imu = ImuChannel("/imu", "body", time_, time_, rows, rows[:, ::-1].copy())
    runs.write(path, wrench=wrench, imu=imu)


JOINTS = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]


def joints_run(path, seconds=2.0):
    """A ramp of forces, and joints that move: position k sin t, velocity k cos t."""
    t = np.arange(round(500 * seconds) + 1) / 500
    stamps = (10**9 + np.round(t * 1e9)).astype(np.int64).tolist()
    turns = np.arange(1, 7)
    with path.open("wb") as stream:
        writer = new_writer(stream)
        numbers = [register(writer, message_definitions.WRENCH, "/wrench")]
        numbers += [register(writer, message_definitions.VALUES, "/joint_states")]
        wrench = encoder(message_definitions.WRENCH, "body")
        joints = encoder(message_definitions.VALUES, "", JOINTS)
        for k, (time_, stamp) in enumerate(zip(t, stamps, strict=True)):
            moved = tuple(np.concatenate([turns * np.sin(time_), turns * np.cos(time_)]).tolist())
            for number, data in zip(
                numbers,
                (wrench(stamp, (time_, -time_, 2 * time_, 1 + time_, 2 - time_, 3 + time_)), joints(stamp, moved)),
                strict=True,
            ):
                writer.add_message(number, stamp, data, stamp, k)
        writer.finish()


@cache
def ramp_file(seconds):
    """The bytes of such a run, which takes seconds to write."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ramp.mcap"
        ramp_run(path, seconds)
        return path.read_bytes()


class Bench:
    """Emulated Bota and Xsens, playing a ramp from the start; ``tell`` sends a command, such as ``unplug imu``."""

    def __init__(self, folder, *, seconds=30.0, loop=False):
        (folder / "ramp.mcap").write_bytes(ramp_file(seconds))
        eye = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
        common = {"run": str(folder / "ramp.mcap"), "matrix": eye, "loop": loop}
        specs = [
            {"name": "cell", "kind": "bota", "options": {"rate": 800.0}, "baudrate": 460800, **common},
            {"name": "imu", "kind": "xsens", "options": {"rate": 400.0}, "baudrate": 921600, **common},
        ]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rig.emulation"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.tell(json.dumps(specs))
        self.ports = json.loads(self.process.stdout.readline())["ports"]
        self.tell("go")
        assert "start" in json.loads(self.process.stdout.readline())
        self.rig = Path(folder) / "rig.toml"
        self.rig.write_text(RIG.format(**self.ports))

    def tell(self, command):
        self.process.stdin.write(command.encode() + b"\n")
        self.process.stdin.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.stdout.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


class Recording:
    """``inertia record --json`` as a process; ready when the constructor returns, unless ``wait`` is False."""

    def __init__(self, *arguments, wait=True, stdin=subprocess.PIPE, **options):
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        command = [sys.executable, "-m", "uq.cli.main", "record", "--json", *map(str, arguments)]
        self.process = subprocess.Popen(
            command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, **options
        )
        self.messages = ""
        while wait and "ready" not in self.messages:
            line = self.process.stderr.readline().decode()
            assert line, self.messages
            self.messages += line

    def stop(self, number=signal.SIGINT):
        """Send a signal and wait for the end; returns (exit status, summary or None, messages)."""
        self.process.send_signal(number)
        return self.end()

    def end(self):
        """Wait for the end."""
        out, err = self.process.communicate(timeout=120)
        self.messages += err.decode()
        return self.process.returncode, json.loads(out) if out else None, self.messages


def refused(*arguments):
    """The one line with which a recording does not start."""
    status, _, messages = Recording(*arguments, wait=False, stdin=subprocess.DEVNULL).end()
    assert status == 2
    (line,) = messages.splitlines()
    assert line.startswith("error: ")
    return line

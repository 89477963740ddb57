"""Load on the recorder: ``python -m benchmarks.rig_load [SECONDS] [--robot [--identify]]``.

Two sensors at 1 kHz and one at 4 kHz on serial lines; with ``--robot`` an ATI Net F/T at 1 kHz over UDP, a robot at 500
Hz over TCP and an Xsens at 400 Hz; with ``--identify`` a second process identifies meanwhile. Prints samples lost and
out of order, processor time of the recorder in percent of one core, its resident memory over time, and how long the
command takes from its start to being ready.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from rig.mcap.message_definitions import IMU, JOINTS, WRENCH

EXPERIMENT = Path(__file__).parent.parent / "uq" / "examples" / "t1-10s.toml"
FACTS = ("samples", "missing", "reordered", "failures", "overflow_bytes", "complete", "clock_skew_ppm")

RIG = """
[[device]]
name = "cell"
kind = "bota"
port = "emulator:run.mcap?loop=1"
wrench = "on_body"
options = { rate = 1000 }

[[device]]
name = "imu"
kind = "microstrain"
port = "emulator:run.mcap?loop=1"
baudrate = 921600
options = { rate = 1000 }

[[device]]
name = "fast"
kind = "microstrain"
port = "emulator:run.mcap?loop=1&rate=4000"
baudrate = 4000000
topic = "/imu_fast"
options = { rate = 4000 }
"""


ROBOT = """
[[device]]
name = "cell"
kind = "ati-net-ft"
port = "emulator:run.mcap?loop=1"
wrench = "on_body"
options = { rate = 1000 }

[[device]]
name = "robot"
kind = "ur-rtde"
port = "emulator:run.mcap?loop=1"
topic = "/robot_wrench"
wrench = "on_sensor"
wrench_frame = "base"
compensated = "none"
options = { rate = 500, wrench_variable = "actual_TCP_force" }

[[device]]
name = "imu"
kind = "xsens"
port = "emulator:run.mcap?loop=1"
baudrate = 921600
options = { rate = 400 }
"""


def write_run(path: Path) -> None:
    """A run of ten seconds to play over and over."""
    t = np.arange(10_001) / 1000
    rows = np.stack([np.sin(t), np.cos(3 * t), np.sin(2 * t)], axis=1)
    time_ = np.round(t * 1e9).astype(np.int64)
    wrench = WrenchChannel("/wrench", "body", time_, time_, 10 * rows, rows)
    runs.write(path, wrench=wrench, imu=ImuChannel("/imu", "body", time_, time_, rows, 9.81 + rows))


def usage(pid: int) -> tuple[float, float]:
    """Processor time [s] and resident memory [MiB] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def record(folder: Path, seconds: float, *more: str) -> dict:
    """Record for so long; returns what the recorder reports and what it used."""
    command = [sys.executable, "-m", "uq.cli.main", "record", str(folder / "rig.toml"), "-o", str(folder / "out.mcap")]
    command += ["--json", *more]
    start = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stderr is not None
    while b"ready" not in process.stderr.readline():
        pass
    ready = time.monotonic() - start
    before, memory, marks = usage(process.pid)[0], [], time.monotonic()
    for _ in range(10):
        time.sleep(seconds / 10)
        memory.append(round(usage(process.pid)[1], 1))
    share = (usage(process.pid)[0] - before) / (time.monotonic() - marks)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    summary = json.loads(out.partition(b"\n")[0])
    return {"ready_s": round(ready, 3), "cpu_percent": round(100 * share, 1), "memory_mib": memory} | {
        "status": process.returncode,
        "summary": summary,
        "messages": err.decode(),
    }


def main() -> None:
    """Run and print."""
    arguments = argparse.ArgumentParser(prog="benchmarks.rig_load", description="Load on the recorder.")
    arguments.add_argument("seconds", nargs="?", type=float, default=600.0, help="how long to record")
    arguments.add_argument("--robot", action="store_true", help="sensors and a robot on the network")
    arguments.add_argument("--identify", action="store_true", help="with --robot: identify meanwhile")
    given = arguments.parse_args()
    seconds, rig = given.seconds, ROBOT if given.robot else RIG
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(rig)
        write_run(folder / "run.mcap")
        (folder / "e.toml").write_text(f'{EXPERIMENT.read_text()}\nwrench_topic = "/wrench"\nmotion_topic = "/imu"\n')
        result = record(folder, seconds, *(("--identify", str(folder / "e.toml")) if given.identify else ()))
        for device, facts in result.pop("summary")["devices"].items():
            print(device, {key: facts[key] for key in FACTS})
        print(result)
        contents = runs.load(folder / "out.mcap", only={WRENCH: None, IMU: None, JOINTS: None})
        for topic, pieces in contents.topics.items():
            columns = pieces.arrays()
            print(
                topic,
                len(columns["stamp"]),
                "samples, steps of the counter",
                set(np.diff(columns["sequence"]).tolist()),
            )
            print("   stamps out of order:", int((np.diff(columns["stamp"]) <= 0).sum()))


if __name__ == "__main__":
    main()

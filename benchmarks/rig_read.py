"""Reading speed and memory. ``python -m benchmarks.rig_read [MESSAGES]``: ours against mcap-ros2-support on one file.

The first part reads the same file with both in the same run and prints the ratio; the second writes a long run, opens
it in a process of its own and prints speed and peak memory.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from rig import runs
from rig.channels import ImuChannel, WrenchChannel

OPEN = """
import sys, time
from rig import runs
start = time.perf_counter()
run = runs.read(sys.argv[1])
took = time.perf_counter() - start
count = len(run.wrench.stamp) + len(run.imu.stamp)
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
peak = int(status["VmHWM"].split()[0]) / 2**20
print(f"{count} messages in {took:.1f} s ({count / took / 1e6:.2f} M/s), peak resident memory {peak:.2f} GiB")
"""


def write_run(path: Path, count: int, compression: str) -> None:
    """``count`` messages, half wrench and half IMU, at 1 kHz each, with noise."""
    n = count // 2
    draw = np.random.default_rng(1)
    time_ = np.arange(n) * 1_000_000
    values = [draw.normal(size=(n, 3)) for _ in range(4)]
    wrench = WrenchChannel("/wrench", "body", time_, time_, *values[:2])
    imu = ImuChannel("/imu", "body", time_, time_, *values[2:])
    runs.write(path, wrench=wrench, imu=imu, compression=compression)


def theirs(path: Path) -> int:
    """Decode every message with mcap-ros2-support."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages())


def ratio(folder: Path) -> None:
    """Print both speeds on the same files, checksums verified by both."""
    for compression in ("none", "zstd", "lz4"):
        path, count = folder / f"{compression}.mcap", 100_000
        write_run(path, count, compression)
        runs.read(path)  # warm-up
        start = time.perf_counter()
        runs.read(path)
        ours = count / (time.perf_counter() - start)
        start = time.perf_counter()
        theirs(path)
        other = count / (time.perf_counter() - start)
        print(f"{compression}: {ours / 1e6:.2f} M/s, mcap-ros2-support {other / 1e3:.0f} k/s: {ours / other:.0f} times")


def main() -> None:
    """Run both parts."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 7_200_000
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ratio(folder)
        write_run(folder / "long.mcap", count, "zstd")
        print(f"long run: {(folder / 'long.mcap').stat().st_size / 2**30:.2f} GiB")
        print(f"writing took {resource.getrusage(resource.RUSAGE_SELF).ru_utime:.0f} s of processor time")
        subprocess.run([sys.executable, "-c", OPEN, str(folder / "long.mcap")], check=True)


if __name__ == "__main__":
    main()

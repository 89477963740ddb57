"""Time and memory of ``identify`` on an hour at 1 kHz: ``python -m benchmarks.long_run [SECONDS]``; needs GNU time.

``--many N`` identifies N runs of 30 s instead, beside a plain script: messages by mcap-ros2-support, alpha by
``numpy.gradient``, the tensor by ``numpy.linalg.lstsq``, nothing said of its uncertainty.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parents[1]
GNU_TIME = ["/usr/bin/time", "--format", "%U %M"]
COMMAND = "from uq.cli.main import main; raise SystemExit(main())"
SIMPLE = """
import sys
import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
R, rows, values = np.array([float(x) for x in sys.argv[1].split()]), [], []
for path in sys.argv[2:]:
    t, wrench, omega = [], [], []
    with open(path, "rb") as stream:
        for _, channel, _, message in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            if channel.topic == "/imu":
                w, stamp = message.angular_velocity, message.header.stamp
                omega.append((w.x, w.y, w.z))
                t.append(stamp.sec + 1e-9 * stamp.nanosec)
            elif channel.topic == "/wrench":
                f, m = message.wrench.force, message.wrench.torque
                wrench.append((f.x, f.y, f.z, m.x, m.y, m.z))
    wrench, omega = np.array(wrench), np.array(omega)
    a, (w1, w2, w3) = np.gradient(omega, np.array(t), axis=0).T, omega.T
    zero = 0 * w1
    x = np.array([[a[0], a[1] - w1 * w3, a[2] + w1 * w2, -w2 * w3, w2**2 - w3**2, w2 * w3],
                  [w1 * w3, a[0] + w2 * w3, w3**2 - w1**2, a[1], a[2] - w1 * w2, -w1 * w3],
                  [-w1 * w2, w1**2 - w2**2, a[0] - w2 * w3, w1 * w2, a[1] + w1 * w3, a[2]]])
    x = np.concatenate([x, np.eye(3)[:, :, None] + zero], axis=1)
    rows.append(x.transpose(2, 0, 1).reshape(-1, 9))
    values.append((wrench[:, 3:] - np.cross(R, wrench[:, :3])).ravel())
print(np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0][:6])
"""


def lasting(folder: Path, seconds: float, rate: int) -> Path:
    """Write the preset with motions of this duration and rate, and return its path."""
    text = (HERE / "uq" / "presets" / "barreto2016.toml").read_text("utf-8")
    text = text.replace('"180 s"', f'"{seconds:g} s"', 1).replace('"400 Hz"', f'"{rate} Hz"', 1)
    path = folder / "experiment.toml"
    path.write_text(text.replace('"27 s"', f'"{0.15 * seconds:g} s"', 1), "utf-8")
    return path


def measured(name: str, *command: str) -> None:
    """Run a command of Python and print its processor time and its peak memory."""
    done = subprocess.run([*GNU_TIME, sys.executable, "-c", *command], capture_output=True, text=True, check=True)
    user, kibibytes = done.stderr.split()[-2:]
    print(f"{name}: {float(user):.1f} s of user time, peak {float(kibibytes) / 2**20:.2f} GiB", flush=True)


def main() -> None:
    """Simulate the runs, identify them, print what it took."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("seconds", nargs="?", type=float, default=3600.0, help="how long the run is")
    arguments.add_argument("--many", type=int, default=0, metavar="N", help="N runs of 30 s at 400 Hz instead")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name:
        seconds, rate = (30.0, 400) if options.many else (options.seconds, 1000)
        experiment = str(lasting(Path(name), seconds, rate))
        runs = [str(Path(name) / f"run{trial}.mcap") for trial in range(max(options.many, 1))]
        for trial, run in enumerate(runs):
            simulate = ["simulate", experiment, "-o", run, "--trial", str(trial)]
            subprocess.run([sys.executable, "-c", COMMAND, *simulate], capture_output=True, check=True)
        for method in ("source", "gls", "joint"):
            measured(f"identify --method {method}", COMMAND, "identify", *runs, "--experiment", experiment,
                     "--method", method)  # fmt: skip
        if options.many:
            measured("plain script", SIMPLE, "0 0 0.053", *runs)


if __name__ == "__main__":
    main()

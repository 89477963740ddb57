"""Time and memory of ``identify`` on an hour at 1 kHz: ``python -m benchmarks.long_run [SECONDS]``; needs GNU time.

``--lengths FIGURE`` identifies runs of 10 s to 3 hours at 1 kHz, and draws the time against the length. ``--many N``
identifies N runs of 30 s instead, beside a plain script: messages by mcap-ros2-support, alpha by ``numpy.gradient``,
the tensor by ``numpy.linalg.lstsq``, nothing said of its uncertainty.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from matplotlib.figure import Figure

HERE = Path(__file__).parents[1]
METHODS = ("source", "gls", "joint")
LENGTHS = (10, 30, 100, 300, 1000, 3600, 10_800)
GNU_TIME = ["/usr/bin/time", "--format", "%U %e %M"]
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


def measured(*command: str) -> tuple[float, float, float]:
    """Run a command of Python; return its processor time [s], its wall time [s] and its peak memory [GiB]."""
    done = subprocess.run([*GNU_TIME, sys.executable, "-c", *command], capture_output=True, text=True, check=True)
    user, wall, kibibytes = map(float, done.stderr.split()[-3:])
    return user, wall, kibibytes / 2**20


def shown(name: str, *command: str) -> None:
    """Run a command of Python and print its times and its peak memory."""
    user, wall, peak = measured(*command)
    print(f"{name}: {user:.1f} s of user time, {wall:.1f} s of wall, peak {peak:.2f} GiB", flush=True)


def simulated(folder: Path, seconds: float, rate: int, count: int) -> tuple[str, list[str]]:
    """Write an experiment and so many simulated runs of it, and return their paths."""
    experiment = str(lasting(folder, seconds, rate))
    runs = [str(folder / f"run{trial}.mcap") for trial in range(count)]
    for trial, run in enumerate(runs):
        Path(run).unlink(missing_ok=True)
        simulate = ["simulate", experiment, "-o", run, "--trial", str(trial)]
        subprocess.run([sys.executable, "-c", COMMAND, *simulate], capture_output=True, check=True)
    return experiment, runs


def against_length(folder: Path, figure: str) -> None:
    """Print processor time and memory of runs of several lengths at 1 kHz, and draw the time; SVG, PDF or PNG."""
    rows = []
    for seconds in LENGTHS:
        experiment, runs = simulated(folder, seconds, 1000, 1)
        rows.append([measured(COMMAND, "identify", *runs, "--experiment", experiment, "--method", method)
                     for method in METHODS])  # fmt: skip
        cells = "; ".join(
            f"{name} {user:.1f} s, {peak:.2f} GiB" for name, (user, _, peak) in zip(METHODS, rows[-1], strict=True)
        )
        print(f"{seconds:g} s: {cells}", flush=True)
    drawing = Figure(figsize=(5, 3.5), layout="constrained")
    axes = drawing.add_subplot(xlabel="length of the run [s]", ylabel="user time [s]", xscale="log", yscale="log")
    for k, name in enumerate(METHODS):
        axes.plot(LENGTHS, [row[k][0] for row in rows], "o-", label=name)
    axes.legend()
    drawing.savefig(figure)


def main() -> None:
    """Simulate the runs, identify them, print what it took."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("seconds", nargs="?", type=float, default=3600.0, help="how long the run is")
    arguments.add_argument("--many", type=int, default=0, metavar="N", help="N runs of 30 s at 400 Hz instead")
    arguments.add_argument("--lengths", metavar="FIGURE", help="runs of 10 s to 3 hours instead, and the figure's file")
    options = arguments.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if options.lengths:
            against_length(Path(name), options.lengths)
            return
        seconds, rate = (30.0, 400) if options.many else (options.seconds, 1000)
        experiment, runs = simulated(Path(name), seconds, rate, max(options.many, 1))
        shown("import jax", "import jax")
        for method in METHODS:
            shown(f"identify --method {method}", COMMAND, "identify", *runs, "--experiment", experiment,
                 "--method", method)  # fmt: skip
        if options.many:
            shown("plain script", SIMPLE, "0 0 0.053", *runs)


if __name__ == "__main__":
    main()

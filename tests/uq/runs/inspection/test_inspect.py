"""``inspect`` finds each planted defect, and nothing in a clean run."""

import subprocess
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from rig.exceptions import RigError
from tests.helpers.rig_samples import SHARED
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.inspection.inspect_run import inspect_run

RATE, SECONDS = 500.0, 12.0


@cache
def clean(seed=1):
    """A body that tilts about all axes under gravity, with noise and jitter of arrival; (wrench, imu)."""
    draw = np.random.default_rng(seed)
    n = int(RATE * SECONDS)
    t = np.arange(n) / RATE
    angles = np.stack([0.3 * np.sin(2.1 * t), 0.25 * np.sin(1.7 * t + 1), 0.4 * np.sin(1.3 * t + 2)], axis=1)
    turns = np.gradient(angles, t, axis=0)
    gravity, omega = np.empty((n, 3)), np.empty((n, 3))
    for i, ((a, b, c), (da, db, dc)) in enumerate(zip(angles, turns, strict=True)):
        roll = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
        pitch = np.array([[np.cos(b), 0, -np.sin(b)], [0, 1, 0], [np.sin(b), 0, np.cos(b)]])
        yaw = np.array([[np.cos(c), np.sin(c), 0], [-np.sin(c), np.cos(c), 0], [0, 0, 1]])
        gravity[i] = roll @ pitch @ yaw @ [0, 0, 9.81]
        omega[i] = roll @ pitch @ [0, 0, dc] + roll @ [0, db, 0] + [da, 0, 0]
    stamp = 10**9 + np.round(t * 1e9).astype(np.int64)
    log_time = stamp + 400_000 + np.abs(draw.normal(scale=100_000, size=n)).astype(np.int64)
    noise = draw.normal(size=(4, n, 3))
    imu = ImuChannel("/imu", "body", log_time, stamp, omega + 1e-3 * noise[0], gravity + 2e-2 * noise[1])
    force = 5 * gravity
    moment = np.cross([0.02, -0.03, 0.1], force) + 0.05 * np.gradient(omega, t, axis=0) + 0.01 * noise[3]
    force = force + noise[2]
    wrench = WrenchChannel("/wrench", "body", log_time, stamp, force, moment)
    return wrench, imu


def held(values, share, seed=3):
    """A share of the samples repeats the one before."""
    values = values.copy()
    for i in np.flatnonzero(np.random.default_rng(seed).random(len(values)) < share):
        values[i] = values[i - 1]
    return values


def one_wild(values, reading):
    values = values.copy()
    values[100, 0] = reading
    return values


def without(channel, keep):
    arrays = ("log_time", "stamp", "force", "moment", "angular_velocity", "linear_acceleration")
    return replace(channel, **{name: getattr(channel, name)[keep] for name in arrays if hasattr(channel, name)})


def gap(channel):
    return without(channel, np.abs((channel.stamp - channel.stamp[0]) * 1e-9 - 4.0) > 0.15)


def skewed(channel):
    late = (channel.stamp - channel.stamp[0]) // 1000  # 1 ms/s
    return replace(channel, stamp=channel.stamp - late)


DEFECTS = {
    "gyro in deg/s": ("unit", "imu", lambda c: replace(c, angular_velocity=np.degrees(c.angular_velocity))),
    "acceleration in g": ("unit", "imu", lambda c: replace(c, linear_acceleration=c.linear_acceleration / 9.80665)),
    "45 % held": ("held", "wrench", lambda c: replace(c, force=held(c.force, 0.45))),
    "45 % held gyro": ("held", "imu", lambda c: replace(c, angular_velocity=held(c.angular_velocity, 0.45))),
    "a 0.3 s gap": ("gap", "wrench", gap),
    "a 0.3 s gap in the IMU": ("gap", "imu", gap),
    "1 ms/s skew": ("skew", "imu", skewed),
    "saturated gyro": ("saturation", "imu", lambda c: replace(c, angular_velocity=c.angular_velocity.clip(-0.4, 0.4))),
    "saturated force": ("saturation", "wrench", lambda c: replace(c, force=c.force.clip(-10, 10))),
    "swapped axes": ("axes", "imu", lambda c: replace(c, linear_acceleration=c.linear_acceleration[:, [1, 0, 2]])),
    "a wrong sign": ("axes", "imu", lambda c: replace(c, linear_acceleration=c.linear_acceleration * [1, 1, -1])),
    "not a number": (
        "not finite",
        "imu",
        lambda c: replace(c, angular_velocity=np.where(c.stamp[:, None] % 7, c.angular_velocity, np.nan)),
    ),
    "a reading of 1e300": ("excess", "imu", lambda c: replace(c, angular_velocity=one_wild(c.angular_velocity, 1e300))),
    "readings of ±1e15": ("excess", "wrench", lambda c: replace(c, force=one_wild(c.force, -1e15))),
    "a constant force": ("constant", "wrench", lambda c: replace(c, force=np.full_like(c.force, 1.5))),
    "no moment at all": ("constant", "wrench", lambda c: replace(c, moment=np.zeros_like(c.moment))),
    "a stuck axis": ("constant", "wrench", lambda c: replace(c, force=c.force * [1, 0, 1] + [0, 3, 0])),
}


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 5))])
def test_a_clean_run_is_not_suspicious(tmp_path, seed):
    wrench, imu = clean(seed)
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu)
    report = inspect_run(tmp_path / "run.mcap")
    assert report.findings == []
    assert [c.samples for c in report.channels] == [6000, 6000]
    for channel in report.channels:
        assert channel.rate_hz == pytest.approx(RATE, rel=1e-6)
        assert channel.arrival_jitter_s == pytest.approx(
            1e-4 * np.sqrt(1 - 2 / np.pi), rel=0.1
        )  # half-normal; 10 sigma
        assert abs(channel.clock_skew_ppm) < 2


@pytest.mark.parametrize("name", DEFECTS)
def test_each_planted_defect_is_found(tmp_path, name):
    kind, which, plant = DEFECTS[name]
    channels = dict(zip(("wrench", "imu"), clean(), strict=True))
    channels[which] = plant(channels[which])
    runs.write(tmp_path / "run.mcap", **channels)
    report = inspect_run(tmp_path / "run.mcap")
    assert kind in {finding.kind for finding in report.findings}
    # accelerometer axes that are not the gyro's do not fit the wrench either
    also = {"/wrench", "/imu"} if kind == "axes" else set()
    assert {finding.topic for finding in report.findings} <= {"/" + which} | also


@pytest.mark.filterwarnings("error")
def test_what_nothing_can_be_computed_of_is_not_judged(tmp_path):
    """A gyro that turns "inf times" faster than gravity would be called one in deg/s."""
    wrench, imu = clean()
    for reading in (1e300, np.inf):
        wild = replace(imu, angular_velocity=one_wild(imu.angular_velocity, reading))
        runs.write(tmp_path / "run.mcap", wrench=wrench, imu=wild, overwrite=True)
        (finding,) = inspect_run(tmp_path / "run.mcap").findings
        assert finding.kind == ("excess" if reading < np.inf else "not finite")


def test_an_imu_without_an_accelerometer_is_not_suspicious(tmp_path):
    wrench, imu = clean()
    bare = replace(imu, linear_acceleration=np.zeros_like(imu.linear_acceleration))
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=bare)
    assert "constant" not in {finding.kind for finding in inspect_run(tmp_path / "run.mcap").findings}


def test_bytes_behind_the_end_are_counted(tmp_path):
    wrench, imu = clean()
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu)
    with open(tmp_path / "run.mcap", "ab") as file:
        file.write(bytes(1234))
    assert "1234 bytes after its end" in str(inspect_run(tmp_path / "run.mcap"))


def test_a_clock_that_was_set_back_is_refused(tmp_path):
    """In the order of their times its samples would stand between those before: smooth, and of no motion."""
    back = lambda c: replace(c, **{n: getattr(c, n) - 10**9 * (np.arange(6000) >= 3000) for n in ("stamp", "log_time")})  # noqa: E731
    runs.write(tmp_path / "run.mcap", **dict(zip(("wrench", "imu"), map(back, clean()), strict=True)))
    with pytest.raises(RigError, match=r"^log times of /wrench in .* step back by 0\.998 s at message 3000: record"):
        inspect_run(tmp_path / "run.mcap")


def test_an_imported_run_is_cured_in_its_map(tmp_path):
    """It says its units itself, so that [recording] of an experiment could only contradict it."""
    wrench, imu = clean()
    turned = DEFECTS["acceleration in g"][2](imu)
    for name, metadata in (("recorded", {}), ("imported", {"rig.run": {"imported": "{}"}})):
        runs.write(tmp_path / f"{name}.mcap", wrench=wrench, imu=turned, metadata=metadata)
    recorded, imported = (str(inspect_run(tmp_path / f"{name}.mcap")) for name in ("recorded", "imported"))
    assert 'set acceleration_unit = "g" in [recording]' in recorded
    assert "of the map" not in recorded
    assert 'set acceleration_unit = "g" in [recording] of the map, on top of what it says, and import' in imported


def test_quantised_smooth_peaks_are_not_saturation(tmp_path):
    wrench, imu = clean()
    t = np.arange(len(wrench.stamp)) / RATE
    smooth = np.stack([10 * np.sin(2 * t), 8 * np.cos(1.5 * t), 50 + 3 * np.sin(t)], axis=1)
    runs.write(tmp_path / "run.mcap", wrench=replace(wrench, force=np.round(smooth * 50) / 50), imu=imu)
    assert "saturation" not in {finding.kind for finding in inspect_run(tmp_path / "run.mcap").findings}


@pytest.mark.skipif(not (SHARED / "throws").is_dir(), reason="the sample data is not here")
def test_the_sample_throws_have_right_units_and_axes():
    for path in sorted((SHARED / "throws").glob("*.mcap")):
        assert not {"unit", "axes", "skew"} & {f.kind for f in inspect_run(path).findings}


def test_the_command(tmp_path, capsys):
    wrench, imu = clean()
    runs.write(tmp_path / "good.mcap", wrench=wrench, imu=imu)
    runs.write(tmp_path / "bad.mcap", wrench=gap(wrench), imu=imu)
    assert main(["inspect", str(tmp_path / "good.mcap")]) == 0
    assert "nothing suspicious" in capsys.readouterr().out
    assert main(["inspect", str(tmp_path / "bad.mcap"), "--json"]) == 1
    assert '"kind": "gap"' in capsys.readouterr().out
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "good.mcap").read_bytes()[:9999])
    assert main(["inspect", str(tmp_path / "cut.mcap")]) == 2
    assert capsys.readouterr().err.startswith("error: cut or damaged")


def test_the_command_needs_neither_jax_nor_scipy(tmp_path):
    """With either it would take twice as long."""
    wrench, imu = clean()
    runs.write(tmp_path / "good.mcap", wrench=wrench, imu=imu)
    code = "import sys; from uq.cli.main import main; assert main(sys.argv[1:]) == 0; "
    code += "sys.exit(' '.join({'jax', 'scipy', 'equinox', 'pint', 'matplotlib', 'msgspec'} & set(sys.modules)) or 0)"
    done = subprocess.run(
        [sys.executable, "-c", code, "inspect", tmp_path / "good.mcap"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr.strip()) == (0, "")


def test_with_an_experiment_a_signal_that_is_never_a_number_is_a_finding(tmp_path):
    """Nothing can be judged against the experiment then; what is wrong is said all the same."""
    wrench, imu = clean()
    force = wrench.force * [np.nan, 1, 1]
    runs.write(tmp_path / "run.mcap", wrench=replace(wrench, force=force), imu=imu)
    report = inspect_run(tmp_path / "run.mcap", Experiment.load("barreto2016"))
    assert [str(finding) for finding in report.findings] == [
        "/wrench: force x is no finite number throughout: check sensor and driver"
    ]

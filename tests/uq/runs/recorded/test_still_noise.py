"""``inertia noise``: from a recording at rest to sources that an experiment includes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identify.signals.run import RunError
from rig.channels import ImuChannel, WrenchChannel
from rig.runs import read, write
from tests.helpers.noise_study import Truth, simulated
from tests.helpers.result_schema import contradictions
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.experiment.recording_table import RecordingTable
from uq.runs.recorded.still_noise import still_noise

TRUTH = {"F": (1e-2, 4e-2, 0.0), "M": (5e-4, 0.0, 0.0), "omega": (1e-4, 0.0, 0.0), "f": (1e-3, 0.0, 0.0)}
CELL, GYRO, SECONDS = 200.0, 100.0, 60.0
STEP = 0.005
EXPERIMENT = Path(__file__).parents[4] / "uq" / "examples" / "t1-10s.toml"


def stamps(rate):
    return 1_700_000_000 * 10**9 + (np.arange(round(SECONDS * rate)) * 1e9 / rate).astype(np.int64)


def recording(path, moves=()):
    """A rig at rest whose cell and IMU have rates of their own; between two instants it moves."""
    generator = np.random.default_rng(1)
    signals = {}
    for target, values in TRUTH.items():
        rate = CELL if target in "FM" else GYRO
        axes = [simulated(Truth(np.array(values), 0.0), rate, round(SECONDS * rate), generator) for _ in range(3)]
        signals[target] = np.stack(axes, axis=1)
    signals["F"] += [0, 0, 193]
    signals["f"] += [0, 0, 9.81]
    signals["M"] = STEP * np.round(signals["M"] / STEP)
    time = np.arange(round(SECONDS * GYRO)) / GYRO
    if moves:
        inside = (time >= moves[0]) & (time <= moves[1])
        signals["omega"][inside] += 0.5 * np.sin(2 * np.pi * time[inside])[:, None]
    about = {"frame_id": "body"}
    wrench = WrenchChannel(
        topic="/wrench", log_time=stamps(CELL), stamp=stamps(CELL), force=signals["F"], moment=signals["M"], **about
    )
    imu = ImuChannel(
        topic="/imu",
        log_time=stamps(GYRO),
        stamp=stamps(GYRO),
        angular_velocity=signals["omega"],
        linear_acceleration=signals["f"],
        **about,
    )
    write(path, wrench=wrench, imu=imu)
    return path


def test_sources_that_an_experiment_includes(tmp_path, capsys):
    still, toml = recording(tmp_path / "still.mcap"), tmp_path / "sources.toml"
    assert main(["noise", str(still), "-o", str(toml), "--out", str(tmp_path / "out")]) == 0
    assert 'use it in an experiment: include = ["sources.toml"]' in capsys.readouterr().out
    assert (tmp_path / "out" / "allan.png").exists()
    assert contradictions((tmp_path / "out" / "result.json").read_text()) == []
    text = EXPERIMENT.read_text().partition("[[source]]")[0]
    (tmp_path / "e.toml").write_text(f'include = ["sources.toml"]\n{text}')
    sources = {source.name: source for source in Experiment.load(tmp_path / "e.toml").sources}
    assert set(sources) == {"F_coloured", "M_coloured", "M_quantisation", "omega_coloured"}
    for target in ("F", "M", "omega"):
        white = sources[f"{target}_coloured"].settings["white"]
        np.testing.assert_allclose(white, TRUTH[target][0], rtol=0.1)
    np.testing.assert_allclose(sources["M_quantisation"].settings["step"], STEP)
    flicker = sources["F_coloured"].settings["flicker"]
    np.testing.assert_allclose(flicker, TRUTH["F"][1], rtol=0.5)
    assert main(["noise", str(still), "-o", str(toml)]) == 2
    assert "sources.toml' exists: give another name" in capsys.readouterr().err


def test_a_part_that_moves_is_left_out_and_told(tmp_path):
    noise = still_noise(recording(tmp_path / "r.mcap", moves=(40.0, 44.0)))
    assert any("rests from 0.0 to 39." in text and "this part is used" in text for text in noise.warnings)
    assert noise.seconds == pytest.approx(39.6, abs=0.5)
    gyro = [channel.noise.values[0] for channel in noise.channels if channel.quantity == "omega"]
    np.testing.assert_allclose(gyro, 1e-4, rtol=0.1)


def test_a_recording_that_moves_is_refused(tmp_path, capsys):
    assert main(["noise", str(recording(tmp_path / "r.mcap", moves=(0.0, 60.0)))]) == 2
    assert "r.mcap does not rest for 10 s: record the rig at rest" in capsys.readouterr().err


def test_a_gap_ends_a_rest(tmp_path):
    """Half a minute, nothing for two, and the other half."""
    path = recording(tmp_path / "r.mcap")
    run = read(path)
    later = [replace(c, **{k: getattr(c, k) + np.where(np.arange(len(c.stamp)) < len(c.stamp) // 2, 0, 120 * 10**9)
                           for k in ("stamp", "log_time")}) for c in (run.wrench, run.imu)]  # fmt: skip
    write(tmp_path / "gap.mcap", wrench=later[0], imu=later[1])
    noise = still_noise(tmp_path / "gap.mcap")
    assert noise.seconds == pytest.approx(30, abs=0.3)
    assert any("of 180.0 s: this part is used" in text for text in noise.warnings)


@pytest.mark.parametrize("value", [np.nan, pytest.param(np.inf, marks=pytest.mark.slow)])
def test_an_accelerometer_that_is_never_a_number_is_left_out(tmp_path, value):
    run = read(recording(tmp_path / "still.mcap"))
    silent = [np.full_like(run.imu.linear_acceleration, number) for number in (0.0, value)]
    silent[1][:, 1:] = 0.0
    without, broken = (
        still_noise(written(tmp_path / f"{k}.mcap", run, run.wrench, replace(run.imu, linear_acceleration=values)))
        for k, values in enumerate(silent)
    )
    assert {channel.quantity for channel in broken.channels} == {"F", "M", "omega"}
    assert broken.records() == without.records()
    force = np.full_like(run.wrench.force, value)
    with pytest.raises(RunError, match="no sample of /wrench holds numbers alone"):
        still_noise(written(tmp_path / "force.mcap", run, replace(run.wrench, force=force), run.imu))


def written(path, run, wrench, imu):
    write(path, wrench=wrench, imu=imu, metadata=run.metadata)
    return path


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("rate", "burst"), [(1e-3, 1), (2.5, 3)], ids=["of 1 mHz", "in bursts of a nanosecond"])
def test_a_channel_whose_samples_lie_far_apart_is_one_line(tmp_path, rate, burst):
    """Each gap would have doubled the parts; the usual step of bursts would have made ten billion instants."""
    run = read(recording(tmp_path / "still.mcap"))
    if burst == 1:
        slow = written(tmp_path / "slow.mcap", run, stretched(run.wrench, rate, burst), run.imu)
        with pytest.raises(RunError, match=r"^slow.mcap does not rest for 10 s: record the rig at rest"):
            still_noise(slow)
    else:
        channels = (stretched(channel, rate, burst) for channel in (run.wrench, run.imu))
        path = written(tmp_path / "slow.mcap", run, *channels)
        with pytest.raises(RunError, match=r"^/wrench in slow.mcap: its samples come in bunches every 400 ms"):
            still_noise(path)
        steady = RecordingTable(wrench_rate=7.5, motion_rate=7.5)
        assert still_noise(path, steady).seconds > 50


def stretched(channel, rate, burst):
    """The channel's first samples in bursts of so many at a rate [Hz]."""
    number = np.arange(600)
    stamp = channel.stamp[0] + (number // burst * 1e9 / rate).astype(np.int64) + number % burst
    return replace(channel.taken(slice(600)), stamp=stamp, log_time=stamp)

"""A recording in which something fails, at a random moment: what came before is kept, what is missing is told."""

import os
import resource
import signal
import time

import numpy as np
import pytest

from rig import inspect, runs
from rig.mcap.recover import recover
from tests.helpers.rig_lab import Bench, Recording, refused

REPEATS = [1, pytest.param(20, marks=pytest.mark.study)]


def fault(tmp_path, repeats, act, check):
    """Repeat: record, do something at a random moment, check what comes of it."""
    draw = np.random.default_rng(6)
    for i in range(repeats):
        folder = tmp_path / str(i)
        folder.mkdir()
        with Bench(folder) as bench:
            recording = Recording(bench.rig, "-o", folder / "run.mcap")
            time.sleep(0.4 + float(draw.random()))
            check(folder, *act(bench, recording))


@pytest.mark.parametrize("repeats", REPEATS)
def test_a_killed_recorder_loses_at_most_a_fifth_of_a_second(tmp_path, repeats):
    def act(bench, recording):
        killed = time.time_ns()
        recording.process.kill()
        return killed, recording.end()[0]

    def check(folder, killed, status):
        assert status == -signal.SIGKILL
        with pytest.raises(ValueError, match="inertia recover"):
            runs.read(folder / "run.mcap")
        result = recover(folder / "run.mcap", folder / "new.mcap")
        assert not result.intact
        run = runs.read(folder / "new.mcap")
        assert run.metadata["rig.run"]["cell.model"] == "SensONE-emulated"
        for channel in (run.wrench, run.imu):
            lost = (killed - channel.log_time[-1]) * 1e-9
            print(f"lost {lost:.3f} s of {channel.topic}")
            assert repeats == 1 or lost < 0.2  # the study runs on a quiet machine; no other test looks at the clock
        played = run.wrench.force[:, 0] > 0
        assert played.sum() > 100
        np.testing.assert_allclose(np.diff(run.wrench.force[played, 0]), 1 / 800, atol=1e-5)

    fault(tmp_path, repeats, act, check)


def one_sensor_lost(command, words, state):
    def act(bench, recording):
        bench.tell(f"{command} imu")
        time.sleep(1.6)
        return recording.stop()

    def check(folder, status, summary, messages):
        assert status == 1
        assert words in messages
        assert summary["devices"]["imu"]["state"] == state
        assert summary["devices"]["cell"]["complete"], summary
        assert not summary["devices"]["imu"]["complete"]
        run = runs.read(folder / "run.mcap")
        for values, rate in ((run.wrench.force, 800), (run.imu.angular_velocity, 400)):
            played = values[:, 0] > 0
            np.testing.assert_allclose(np.diff(values[played, 0]), 1 / rate, atol=1e-5)
        assert run.wrench.log_time[-1] - run.imu.log_time[-1] > 1.0e9
        assert "incomplete" in {f.kind for f in inspect(folder / "run.mcap").findings}

    return act, check


FAULTS = {
    "unplug": ("port", "unplugged"),
    "silence": ("no more samples", "silent"),
    "babble": ("invalid data", "babbling"),
}


@pytest.mark.parametrize("repeats", REPEATS)
@pytest.mark.parametrize("command", [pytest.param("unplug", marks=pytest.mark.study), "silence", "babble"])
def test_one_sensor_fails_and_the_other_is_recorded_whole(tmp_path, command, repeats):
    fault(tmp_path, repeats, *one_sensor_lost(command, *FAULTS[command]))


@pytest.mark.parametrize("repeats", REPEATS)
def test_a_sensor_that_comes_back_is_recorded_again(tmp_path, repeats):
    def act(bench, recording):
        bench.tell("unplug imu")
        time.sleep(0.7)
        bench.tell("plug imu")
        time.sleep(1.8)
        return recording.stop()

    def check(folder, status, summary, messages):
        assert status == 1
        assert "port" in messages
        assert "samples again" in messages
        imu = summary["devices"]["imu"]
        assert (imu["state"], imu["reconnects"]) == ("ok", 1)
        assert 0.5 < imu["down_s"] < 2.2
        assert summary["devices"]["cell"]["complete"]
        run = runs.read(folder / "run.mcap")
        steps = np.diff(run.imu.angular_velocity[run.imu.angular_velocity[:, 0] > 0, 0])
        assert (np.abs(steps - 1 / 400) > 1e-5).sum() == 1  # the one gap
        np.testing.assert_allclose(run.wrench.stamp[-1] - run.imu.stamp[-1], 0, atol=0.1e9)

    fault(tmp_path, repeats, act, check)


@pytest.mark.parametrize("repeats", REPEATS)
def test_a_full_disk_ends_the_recording_and_keeps_what_was_there(tmp_path, repeats):
    """A limit on the size of the file stands for the full disk."""
    draw = np.random.default_rng(7)
    for i in range(repeats):
        folder = tmp_path / str(i)
        folder.mkdir()
        limit = int(draw.integers(30_000, 120_000))
        with Bench(folder) as bench:
            recording = Recording(bench.rig, "-o", folder / "run.mcap", wait=False)
            resource.prlimit(recording.process.pid, resource.RLIMIT_FSIZE, (limit, limit))
            status, _, messages = recording.end()
        assert status == 2
        assert messages.splitlines()[-1].startswith("error: cannot write")
        assert "raise the limit on the size of files" in messages
        assert (folder / "run.mcap").stat().st_size <= limit
        result = recover(folder / "run.mcap", folder / "new.mcap")
        assert result.lost_bytes == 0
        run = runs.read(folder / "new.mcap")
        assert np.diff(run.imu.sequence.astype(int)).tolist() == [1] * (len(run.imu.sequence) - 1)


def test_a_disk_that_was_full_from_the_start_leaves_no_file(tmp_path):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap", wait=False)
        resource.prlimit(recording.process.pid, resource.RLIMIT_FSIZE, (100, 100))
        status, _, messages = recording.end()
    assert status == 2
    assert messages.splitlines()[-1].endswith("nothing was recorded, raise the limit on the size of files (ulimit -f)")
    assert not (tmp_path / "run.mcap").exists()


def test_an_output_that_is_deleted_while_recording_is_said_and_ends_it(tmp_path):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap")
        time.sleep(0.2)
        (tmp_path / "run.mcap").unlink()
        status, summary, messages = recording.end()
    assert (status, summary) == (2, None)
    assert messages.splitlines()[-1].startswith("error: output deleted while recording")


def test_an_output_that_is_moved_while_recording_is_whole_and_said_to_be_elsewhere(tmp_path):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap")
        time.sleep(0.2)
        (tmp_path / "run.mcap").rename(tmp_path / "other.mcap")
        status, summary, messages = recording.stop()
    assert (status, summary["complete"]) == (0, True)
    assert "was moved or replaced while recording" in messages
    assert "was moved or replaced" in summary["warnings"][-1]
    assert len(runs.read(tmp_path / "other.mcap").wrench.stamp) > 20


def test_an_output_that_is_cut_while_recording_is_reported_and_the_rest_is_kept(tmp_path):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap")
        time.sleep(0.3)
        os.truncate(tmp_path / "run.mcap", 1000)
        time.sleep(0.5)
        status, summary, messages = recording.stop()
    assert (status, summary["complete"]) == (1, False)
    assert [line for line in messages.splitlines() if "was cut by another program" in line] == messages.splitlines()[
        -1:
    ]
    assert recover(tmp_path / "run.mcap", tmp_path / "new.mcap").messages > 20
    assert len(runs.read(tmp_path / "new.mcap").wrench.stamp) > 20


def test_ctrl_c_again_and_again_ends_a_recording_like_one(tmp_path):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap")
        time.sleep(0.2)
        while recording.process.poll() is None:
            recording.process.send_signal(signal.SIGINT)
            time.sleep(0.002)
        status, summary, messages = recording.end()
    assert "Traceback" not in messages
    assert (status, summary["complete"]) == (0, True)


@pytest.mark.parametrize("repeats", REPEATS)
def test_a_folder_that_cannot_be_written_is_one_line(tmp_path, repeats):
    """/sys is read-only for everybody, root too."""
    with Bench(tmp_path) as bench:
        for _ in range(repeats):
            assert "check the path and its permissions" in refused(bench.rig, "-o", "/sys/run.mcap")
            assert "check the path and its permissions" in refused(bench.rig, "-o", "/sys/runs/")
            assert "no folder" in refused(bench.rig, "-o", "/nowhere/run.mcap")

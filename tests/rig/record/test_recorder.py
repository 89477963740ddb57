"""Recording from emulated sensors, whole: what was played is in the file, and what cannot start says why."""

import signal
import socket
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from rig import runs
from tests.helpers.emulated_rig import emulated_rig
from tests.helpers.rig_lab import Bench, Recording, refused


@pytest.fixture
def emulated(tmp_path):
    return emulated_rig(tmp_path)


def check_ramp(run, *, whole=True):
    """Every sample in its place: values grow by the same step from sample to sample, in f32."""
    for values, rate in ((run.wrench.force, 800), (run.imu.angular_velocity, 400)):
        expected = (np.arange(len(values)) / rate).astype(np.float32)
        shift = values[0, 0] if not whole else 0.0
        np.testing.assert_allclose(values[:, 0] - shift, expected, atol=1e-5)
        np.testing.assert_allclose(values[:, 1] + shift, -expected, atol=1e-5)


def test_one_command_records_an_emulated_run_whole(emulated, tmp_path):
    """Ends by itself with the run; the reading is turned to the body frame and its sign; nothing is missing."""
    recording = Recording(emulated, "-o", tmp_path / "run.mcap", "--note", "a test")
    status, summary, _ = recording.end()
    assert (status, summary["complete"]) == (0, True)
    run = runs.read(tmp_path / "run.mcap")
    assert (len(run.wrench.stamp), len(run.imu.stamp)) == (2401, 1201)
    check_ramp(run)
    np.testing.assert_array_equal(run.imu.sequence - run.imu.sequence[0], np.arange(1201))
    assert run.metadata["rig.run"]["note"] == "a test"
    assert run.metadata["rig.run"]["imu.model"] == "MTi-emulated"
    assert run.metadata["rig.run"]["imu.read_back.4020_hz"] == "400"
    assert run.metadata["rig.end"]["complete"] == "true"
    # a skew of 80 ppm is in the clock fit: 3 s of run, jitter well below 0.3 ms, so within 100 ppm
    assert abs(float(run.metadata["rig.end"]["imu.clock_skew_ppm"]) + 80) < 100
    topics = check_foreign_readers(tmp_path / "run.mcap")
    assert topics["/raw/cell"] > 0
    assert topics["/diagnostics"] >= 3


def check_foreign_readers(path):
    """mcap-ros2-support and rosbags decode every message of every topic, and find the same numbers."""
    counts, forces = {}, []
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for item in reader.iter_decoded_messages():
            counts[item.channel.topic] = counts.get(item.channel.topic, 0) + 1
            if item.channel.topic == "/wrench":
                forces.append(item.decoded_message.wrench.force.x)
    others, theirs = {}, []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            others[connection.topic] = others.get(connection.topic, 0) + 1
            if connection.topic == "/wrench":
                theirs.append(message.wrench.force.x)
    assert counts == others
    assert forces == theirs == runs.read(path).wrench.force[:, 0].tolist()
    return counts


def test_runs_in_a_folder_are_numbered_and_none_is_overwritten(emulated, tmp_path):
    folder = tmp_path / "runs"
    for _ in range(2):
        assert Recording(emulated, "-o", f"{folder}/", "--seconds", "0.3").end()[0] == 0
    assert sorted(p.name for p in folder.iterdir()) == ["run_0001.mcap", "run_0002.mcap"]
    before = (folder / "run_0001.mcap").read_bytes()
    status, _, messages = Recording(emulated, "-o", folder / "run_0001.mcap", wait=False).end()
    assert status == 2
    assert messages.startswith("error: output exists")
    assert (folder / "run_0001.mcap").read_bytes() == before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_recording_cleanly_and_marks_are_kept(tmp_path, number):
    with Bench(tmp_path) as bench:
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap")
        time.sleep(0.3)
        recording.process.stdin.write("start of the motion\nsecond: ω\n".encode())
        recording.process.stdin.flush()
        time.sleep(0.5)
        status, summary, _ = recording.stop(number)
    assert (status, summary["complete"], summary["marks"]) == (0, True, 2)
    with open(tmp_path / "run.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        marks = [item.decoded_message.data for item in reader.iter_decoded_messages(topics=["/mark"])]
    assert marks == ["start of the motion", "second: ω"]


def test_ports_that_cannot_be_opened_say_what_to_do(tmp_path):
    rig, output = tmp_path / "rig.toml", tmp_path / "run.mcap"
    rig.write_text('[[device]]\nname = "imu"\nkind = "xsens"\nport = "/dev/ttyNOTHING"\n')
    assert "plug the device in" in refused(rig, "-o", output)
    rig.write_text(f'[[device]]\nname = "imu"\nkind = "xsens"\nport = "{tmp_path}/rig.toml"\n')
    assert "is it a serial port?" in refused(rig, "-o", output)
    assert not output.exists()


def test_a_busy_port_and_a_wrong_kind_and_a_mute_device(tmp_path):
    with Bench(tmp_path) as bench:
        rig, output = tmp_path / "other.toml", tmp_path / "run.mcap"
        table = '[[device]]\nname = "imu"\nkind = "{kind}"\nport = "{port}"\n{more}\n'
        recording = Recording(bench.rig, "-o", output)
        assert "port busy" in refused(bench.rig, "-o", tmp_path / "second.mcap")
        recording.stop()
        rig.write_text(table.format(kind="vectornav", port=bench.ports["imu"], more=""))
        assert "no valid data in the" in refused(rig, "-o", tmp_path / "third.mcap")
        more = "options = { configure = false }"
        rig.write_text(table.format(kind="vectornav", port=bench.ports["imu"], more=more))
        assert "no valid data in the bytes of imu" in refused(rig, "-o", tmp_path / "third.mcap")
        bench.tell("silence imu")
        rig.write_text(table.format(kind="xsens", port=bench.ports["imu"], more=""))
        assert "no bytes from imu" in refused(rig, "-o", tmp_path / "third.mcap")
        assert not (tmp_path / "third.mcap").exists()


COMMANDED = """
[[device]]
name = "imu"
kind = "xsens"
port = "emulator:run.mcap?delay=0.0213&loop=1"
baudrate = 921600
options = { rate = 400 }

[[device]]
name = "platform"
kind = "line"
port = "emulator:run.mcap?loop=1"
baudrate = 921600
delay_to = "imu"
options = { rate = 200, columns = ["counter", "time us", "omega_x deg/s", "omega_y deg/s", "stroke mm"] }
"""


def test_the_platforms_command_is_recorded_and_its_delay_estimated(tmp_path):
    """The emulated IMU shows the motion 21.3 ms later; pty and pacing jitter stays below 1 ms."""
    from rig.channels import ImuChannel, WrenchChannel

    t = np.arange(4001) / 400
    wave = np.stack([0.3 * np.sin(2 * np.pi * 0.8 * t), 0.1 * np.sin(2 * np.pi * 1.3 * t), 0 * t], axis=1)
    time_ = 10**9 + np.round(t * 1e9).astype(np.int64)
    zero = np.zeros_like(wave)
    runs.write(
        tmp_path / "run.mcap",
        wrench=WrenchChannel("/wrench", "body", time_, time_, zero, zero),
        imu=ImuChannel("/imu", "body", time_, time_, wave, zero + np.array([0, 0, 9.81])),
    )
    (tmp_path / "rig.toml").write_text(COMMANDED)
    status, summary, _ = Recording(tmp_path / "rig.toml", "-o", tmp_path / "out.mcap", "--seconds", "4").end()
    assert status == 0
    found = summary["delays"]["platform"]
    assert found["delay_correlation"] > 0.99
    assert found["delay_s"] == pytest.approx(0.0213, abs=1e-3)
    with open(tmp_path / "out.mcap", "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        rows = [item.decoded_message for item in reader.iter_decoded_messages(topics=["/platform"])]
    assert rows[0].name == ["omega_x", "omega_y", "stroke"]
    got = np.array([row.position for row in rows])
    assert len(got) > 700
    np.testing.assert_allclose(got[:400, 0], wave[: 2 * 400 : 2, 0], atol=1e-9)


def test_udp_lines_are_a_device(tmp_path):
    rig = tmp_path / "rig.toml"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        number = probe.getsockname()[1]
    rig.write_text(
        f'[[device]]\nname = "pose"\nkind = "line"\nport = "udp:{number}"\n'
        'options = { columns = ["counter", "x mm"], separator = "," }\n'
    )
    recording = Recording(rig, "-o", tmp_path / "run.mcap", "--seconds", "1", wait=False)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for i in range(30_000):  # two minutes at most; the recording ends by itself
            sender.sendto(b"%d,%d" % (i, 2 * i), ("127.0.0.1", number))
            time.sleep(0.004)
            if recording.process.poll() is not None:
                break
    status, summary, messages = recording.end()
    assert status == 0, messages
    assert summary["devices"]["pose"]["samples"] > 50
    assert summary["devices"]["pose"]["missing"] == 0


def test_a_command_that_never_comes_does_not_stop_a_recording(tmp_path):
    with Bench(tmp_path) as bench, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        number = probe.getsockname()[1]
        probe.close()
        more = f'[[device]]\nname = "pose"\nkind = "line"\nport = "udp:{number}"\noptions = {{ columns = ["x mm"] }}\n'
        bench.rig.write_text(bench.rig.read_text() + more)
        status, summary, _ = Recording(bench.rig, "-o", tmp_path / "run.mcap", "--seconds", "0.5").end()
    assert (status, summary["devices"]["pose"]["samples"]) == (0, 0)


def stops_cleanly(pid):
    """Whether a process has its handler of SIGTERM, and so that of Ctrl-C, in place."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return bool(int(status["SigCgt"], 16) >> (signal.SIGTERM - 1) & 1)


def test_stopping_while_a_device_is_awaited_records_nothing(tmp_path):
    with Bench(tmp_path) as bench:
        bench.rig.write_text(bench.rig.read_text().replace('"xsens"', '"microstrain"'))
        recording = Recording(bench.rig, "-o", tmp_path / "run.mcap", wait=False)
        while not stops_cleanly(recording.process.pid):
            time.sleep(0.02)
        time.sleep(0.2)
        status, _, messages = recording.stop()
    assert status == 2
    assert messages.startswith("error: stopped before all devices had answered")
    assert not (tmp_path / "run.mcap").exists()

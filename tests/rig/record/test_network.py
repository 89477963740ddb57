"""Devices on the network, whole: loss and disorder in the file, restarts, wrong addresses, and what is said of them."""

import contextlib
import socket
import threading
import time

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from rig import runs
from rig.exceptions import RigError
from rig.record import port
from rig.record.port import Address, PortLostError, open_port
from tests.helpers.network_rigs import ATI, UR, playing
from tests.helpers.rig_lab import JOINTS, Recording, joints_run, ramp_run, refused


@pytest.fixture
def folder(tmp_path):
    ramp_run(tmp_path / "ramp.mcap", seconds=2.0, rate=1000.0)
    return tmp_path


@pytest.fixture
def arm(tmp_path):
    joints_run(tmp_path / "arm.mcap")
    return tmp_path


def test_lost_and_reordered_datagrams_of_a_recording_are_counted_exactly(folder):
    """Every 50th is lost, every 77th comes after its successor: the file has the rest, in order, each in its place."""
    (folder / "rig.toml").write_text(ATI.format(port="emulator:ramp.mcap?lose=50&swap=77"))
    status, summary, _ = Recording(folder / "rig.toml", "-o", folder / "run.mcap").end()
    cell = summary["devices"]["cell"]
    wrench = runs.load(folder / "run.mcap").topics["/wrench"].arrays()
    numbers = wrench["sequence"].astype(int)
    between = np.arange(numbers[0], numbers[-1] + 1)
    assert len(numbers) > 1000
    assert sorted(set(between) - set(numbers)) == [n for n in between if n % 50 == 0]
    assert (status, cell["missing"]) == (1, sum(between % 50 == 0))
    assert cell["reordered"] == sum((between % 77 == 0) & (between % 50 != 0))
    assert cell["repeated"] == cell["failures"] == cell["resynchronisations"] == 0
    assert np.all(np.diff(wrench["stamp"]) > 0)
    np.testing.assert_allclose(np.diff(wrench["force"][:, 0]), 0.001 * np.diff(numbers), atol=2e-6)


def test_a_clock_that_counts_something_else_is_said(folder):
    """One that runs five per cent slow, as if the sensor's internal rate were not the one on its page."""
    (folder / "rig.toml").write_text(ATI.format(port="emulator:ramp.mcap?loop=1&skew_ppm=-50000"))
    _, _, messages = Recording(folder / "rig.toml", "-o", folder / "run.mcap", "--seconds", "2.6").end()
    assert "warning: cell: its clock and this computer's differ by 5." in messages


def test_a_sensor_that_was_restarted_is_found_again(folder):
    with playing(folder, ATI.format(port="emulator:ramp.mcap?loop=1")) as (emulators, rig):
        recording = Recording(rig, "-o", folder / "run.mcap")
        time.sleep(0.3)
        emulators.command("unplug cell")
        emulators.command("plug cell")
        time.sleep(port.QUIET + 2.0)
        status, summary, messages = recording.stop()
    assert (status, summary["devices"]["cell"]["reconnects"]) == (1, 1)
    assert "lost, waiting for it to come back" in messages
    assert "cell: samples again after" in messages
    assert len(runs.load(folder / "run.mcap").topics["/wrench"].arrays()["stamp"]) > 500


@contextlib.contextmanager
def chatter():
    """A UDP socket that answers everything with words."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(5)

        def talk():
            with contextlib.suppress(OSError):
                while True:
                    other.sendto(b"hello", other.recvfrom(100)[1])

        threading.Thread(target=talk, daemon=True).start()
        yield other.getsockname()[1]


def test_another_device_at_the_address_is_named(tmp_path):
    with chatter() as number:
        (tmp_path / "rig.toml").write_text(ATI.format(port=f"udp://127.0.0.1:{number}"))
        line = refused(tmp_path / "rig.toml", "-o", tmp_path / "run.mcap")
    assert "another device than 'ati-net-ft' is at this address" in line


def free_number(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_an_address_where_nobody_is_says_so(tmp_path):
    (tmp_path / "rig.toml").write_text(ATI.format(port=f"udp://127.0.0.1:{free_number()}"))
    assert "Connection refused" in refused(tmp_path / "rig.toml", "-o", tmp_path / "run.mcap")
    with pytest.raises(RigError, match="no connection to tcp://127"):
        open_port(f"tcp://127.0.0.1:{free_number(socket.SOCK_STREAM)}", 0)
    with pytest.raises(RigError, match="no address nowhere"):
        open_port("udp://nowhere.invalid", 0, number=49152)


def test_silence_on_the_network_is_a_lost_port(monkeypatch):
    """A sensor that was switched off and on again has forgotten who listened: it must be asked anew."""
    monkeypatch.setattr(port, "QUIET", 0.15)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        line = open_port(f"udp://127.0.0.1:{other.getsockname()[1]}", 0)
        assert line.read() == b""
        with pytest.raises(PortLostError, match="nothing for 0"):
            line.read()
        line.close()


def test_a_connection_that_is_closed_is_a_lost_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        line = open_port(f"tcp://127.0.0.1:{server.getsockname()[1]}", 0)
        other, _ = server.accept()
        other.sendall(b"bytes")
        assert line.read() == b"bytes"
        line.write(b"back")
        assert other.recv(10) == b"back"
        other.close()
        with pytest.raises(PortLostError, match="it hung up"):
            line.read()
        line.close()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("udp://192.168.1.1", Address("udp", "192.168.1.1", 49152, {})),
        ("tcp://robot.lan:30004", Address("tcp", "robot.lan", 30004, {})),
        ("udp://[fe80::1]:5?80=8080&81=90", Address("udp", "fe80::1", 5, {80: 8080, 81: 90})),
    ],
)
def test_addresses(name, expected):
    assert Address.of(name, 49152) == expected


def test_a_robots_wrench_and_joints_are_recorded_together(arm):
    """Wrench in the body's axes and sign, joints under the standard's topic, other values beside; foreign readers."""
    (arm / "rig.toml").write_text(UR.format(port="emulator:arm.mcap"))
    status, summary, messages = Recording(arm / "rig.toml", "-o", arm / "run.mcap").end()
    assert (status, summary["devices"]["robot"]["missing"]) == (0, 0), messages
    run = runs.read_any(arm / "run.mcap", wrench="/wrist")
    assert (run.motion.topic, list(run.motion.names)) == ("/joint_states", JOINTS)
    t = np.arange(1001) / 500
    assert run.wrench.force.shape == run.motion.position[:, :3].shape == (1001, 3)
    np.testing.assert_allclose(run.wrench.force, np.stack([t, -t, 2 * t], axis=1), atol=1e-9)
    np.testing.assert_allclose(run.motion.position, np.sin(t)[:, None] * np.arange(1, 7), atol=1e-9)
    np.testing.assert_allclose(run.motion.velocity, np.cos(t)[:, None] * np.arange(1, 7), atol=1e-9)
    np.testing.assert_array_equal(run.wrench.stamp, run.motion.stamp)
    about = run.metadata["rig.run"]
    assert (about["robot.model"], about["robot.compensated"], about["robot.wrench_frame"]) == (
        "UR-emulated",
        "gravity",
        "base",
    )
    with AnyReader([arm / "run.mcap"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        connections = [c for c in reader.connections if c.topic in ("/joint_states", "/robot")]
        read = [(c.topic, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(connections)]
    states = [message for topic, message in read if topic == "/joint_states"]
    assert states[500].name == JOINTS
    np.testing.assert_array_equal([state.position for state in states], run.motion.position)
    np.testing.assert_array_equal([state.velocity for state in states], run.motion.velocity)
    assert len(states[0].effort) == 0
    others = [message for topic, message in read if topic == "/robot"]
    assert others[0].name == [f"actual_tool_accelerometer_{i}" for i in range(3)]
    assert len(others) == len(states) == 1001


def test_a_robot_that_hangs_up_is_found_again(arm):
    with playing(arm, UR.format(port="emulator:arm.mcap?loop=1")) as (emulators, rig):
        recording = Recording(rig, "-o", arm / "run.mcap")
        time.sleep(0.3)
        emulators.command("unplug robot")
        time.sleep(0.4)
        emulators.command("plug robot")
        time.sleep(1.5)
        status, summary, messages = recording.stop()
    assert (status, summary["devices"]["robot"]["reconnects"]) == (1, 1)
    assert "robot: samples again after" in messages

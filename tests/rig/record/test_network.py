"""Devices on the network, whole: loss and disorder in the file, restarts, wrong addresses, and what is said of them."""

import contextlib
import socket
import threading
import time

import numpy as np
import pytest

from rig import runs
from rig.exceptions import RigError
from rig.record import port
from rig.record.port import Address, PortLostError, open_port
from rig.record.rig_file import load_rig
from rig.record.session import Emulators
from tests.rig_lab import Recording, ramp_run, refused
from uq.cli.main import main

ATI = """
[[device]]
name = "cell"
kind = "ati-net-ft"
port = "{port}"
wrench = "on_body"
"""


@pytest.fixture
def folder(tmp_path):
    ramp_run(tmp_path / "ramp.mcap", seconds=2.0, rate=1000.0)
    return tmp_path


@contextlib.contextmanager
def playing(folder, text):
    """The emulated devices of a rig file; gives them, and the rig file that names their sockets."""
    (folder / "emulated.toml").write_text(text)
    rig = load_rig(folder / "emulated.toml")
    emulators = Emulators(list(rig.entries), folder)
    try:
        for name, number in emulators.ports().items():
            entry = next(entry for entry in rig.entries if entry.name == name)
            text = text.replace(f'"{entry.port}"', f'"{number}"')
        (folder / "rig.toml").write_text(text)
        emulators.go()
        yield emulators, folder / "rig.toml"
    finally:
        emulators.close()


def test_lost_and_reordered_datagrams_of_a_recording_are_counted_exactly(folder):
    """Every 50th is lost, every 77th comes after its successor: the file has the rest, in order, each in its place."""
    (folder / "rig.toml").write_text(ATI.format(port="emulator:ramp.mcap?lose=50&swap=77"))
    status, summary, _ = Recording(folder / "rig.toml", "-o", folder / "run.mcap").end()
    cell = summary["devices"]["cell"]
    wrench = runs.load(folder / "run.mcap").topics["/wrench"].arrays()
    numbers = wrench["sequence"].astype(int)
    between = np.arange(numbers[0], numbers[-1] + 1)
    assert len(numbers) > 1900
    assert sorted(set(between) - set(numbers)) == [n for n in between if n % 50 == 0]
    assert (status, cell["missing"]) == (1, sum(between % 50 == 0))
    assert cell["reordered"] == sum((between % 77 == 0) & (between % 50 != 0))
    assert cell["repeated"] == cell["failures"] == cell["resynchronisations"] == 0
    assert np.all(np.diff(wrench["stamp"]) > 0)
    np.testing.assert_allclose(np.diff(wrench["force"][:, 0]), 0.001 * np.diff(numbers), atol=2e-6)


def test_a_sensor_that_was_restarted_is_found_again(folder):
    with playing(folder, ATI.format(port="emulator:ramp.mcap?loop=1")) as (emulators, rig):
        recording = Recording(rig, "-o", folder / "run.mcap")
        time.sleep(0.3)
        emulators.command("unplug cell")
        emulators.command("plug cell")
        time.sleep(port.QUIET + 1.0)
        status, summary, messages = recording.stop()
    assert (status, summary["devices"]["cell"]["reconnects"]) == (1, 1)
    assert "lost, waiting for it to come back" in messages
    assert "cell: samples again after" in messages
    assert len(runs.load(folder / "run.mcap").topics["/wrench"].arrays()["stamp"]) > 500


def test_a_device_is_listed_by_its_address(folder, capsys):
    with playing(folder, ATI.format(port="emulator:ramp.mcap?loop=1")) as (_, rig):
        (entry,) = load_rig(rig).entries
        assert main(["record", "--list", entry.port]) == 0
    assert "kind 'ati-net-ft': Net F/T-emulated serial FT00001 firmware 0.0.0" in capsys.readouterr().out


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


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ATI.format(port="udp://"), "write udp://ADDRESS or tcp://ADDRESS:NUMBER"),
        (ATI.format(port="udp://a:99999"), "write udp://ADDRESS or tcp://ADDRESS:NUMBER"),
        (ATI.format(port="udp://a?80=x"), "write udp://ADDRESS or tcp://ADDRESS:NUMBER"),
        (ATI.format(port="/dev/ttyUSB0"), "'ati-net-ft' is on the network: write udp://ADDRESS"),
        (ATI.format(port="tcp://192.168.1.1"), "'ati-net-ft' is on the network: write udp://ADDRESS"),
        (ATI.format(port="udp:5005"), "'ati-net-ft' is on the network: write udp://ADDRESS"),
        (ATI.format(port="udp://a") + "baudrate = 9600", "baudrate is for serial lines"),
        (ATI.format(port="udp://a").replace("ati-net-ft", "bota"), "a serial server is tcp://ADDRESS:NUMBER"),
        (ATI.format(port="tcp://a").replace("ati-net-ft", "bota"), "a serial server is tcp://ADDRESS:NUMBER"),
        (
            ATI.format(port="emulator:a.mcap?lose=9").replace("ati-net-ft", "bota"),
            "'lose' and 'swap' in the port of cell",
        ),
        (ATI.format(port="udp://a") + "options = { counts_per_force = -1 }", "numbers above 0"),
        (ATI.format(port="udp://a") + "options = { rate = 0.5 }", "1 Hz or more"),
    ],
)
def test_a_wrong_rig_file_says_what_to_do(tmp_path, capsys, text, words):
    (tmp_path / "rig.toml").write_text(text)
    assert main(["record", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "run.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line

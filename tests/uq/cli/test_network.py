"""``inertia record`` on the network: devices listed by address, wrong rig files, a robot's wrench."""

import pytest

from rig.record.rig_file import load_rig
from tests.helpers.network_rigs import ATI, UR, playing
from tests.helpers.rig_lab import joints_run, ramp_run
from uq.cli.main import main


@pytest.fixture
def folder(tmp_path):
    ramp_run(tmp_path / "ramp.mcap", seconds=2.0, rate=1000.0)
    return tmp_path


@pytest.fixture
def arm(tmp_path):
    joints_run(tmp_path / "arm.mcap")
    return tmp_path


def test_devices_are_listed_by_their_addresses(folder, capsys):
    with playing(folder, ATI.format(port="emulator:ramp.mcap?loop=1") + UR.format(port="emulator:ramp.mcap")) as (
        _,
        rig,
    ):
        assert main(["record", "--list", *(entry.port for entry in load_rig(rig).entries)]) == 0
    cell, robot = capsys.readouterr().out.splitlines()
    assert "kind 'ati-net-ft': Net F/T-emulated serial FT00001 firmware 0.0.0" in cell
    assert "kind 'ur-rtde': UR-emulated serial 20260000000 firmware 5.0.0.0" in robot


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


@pytest.mark.parametrize(
    ("cut", "words"),
    [
        ('wrench = "on_sensor"\n', "say whether the reading is the wrench 'on_body' or 'on_sensor'"),
        ('wrench_frame = "base"\n', "wrench_frame: say whether its wrench is along 'sensor' or 'base' axes"),
        ('compensated = "gravity"\n', "compensated: say whether the robot removes weight, 'none' or 'gravity'"),
        ('wrench_variable = "actual_TCP_force", ', "missing key device[robot].options.wrench_variable"),
    ],
)
def test_what_a_robot_does_to_its_wrench_is_not_guessed(arm, capsys, cut, words):
    text = UR.format(port="emulator:arm.mcap")
    assert cut in text
    (arm / "rig.toml").write_text(text.replace(cut, ""))
    assert main(["record", str(arm / "rig.toml"), "-o", str(arm / "run.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    (arm / "rig.toml").write_text(ATI.format(port="udp://a") + 'wrench_frame = "base"')
    assert main(["record", str(arm / "rig.toml"), "-o", str(arm / "run.mcap")]) == 2
    assert "are for robots: remove them" in capsys.readouterr().err

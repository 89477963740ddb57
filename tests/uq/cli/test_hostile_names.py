"""Names that clear the screen, turn text around or forge a line: no command prints one as it is."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig import runs
from rig.channels import MotionChannel
from rig.mcap.message_definitions import JOINTS
from tests.helpers import bags
from uq.cli.main import COMMANDS, main
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate

NAME = "x\x1b[2J\u202e\x9b\r\nwarning: forged\u2028warning: forged"
BRIEF = (Path(__file__).parents[3] / "uq" / "examples" / "t1-10s.toml").read_text("utf-8")
BRIEF = BRIEF.replace('"10 s"', '"4 s"').replace('"1.5 s"', '"0.6 s"').replace('"400 Hz"', '"200 Hz"')
ARM = """<robot name="{0}"><link name="{0}"/><link name="tool"/><joint name="{0}j" type="continuous">
<parent link="{0}"/><child link="tool"/><axis xyz="1 0 0"/></joint></robot>"""
"""An arm of one joint; XML takes no control characters of C0 but the ends of lines."""
IN_XML = NAME.replace("\x1b", "")
ON_ARM = """[recording]
wrench = "on_body"
urdf = "arm.urdf"
urdf_frame = "FRAME"
[[estimator]]
name = "smoothed"
differentiator = "savitzky-golay"
band = "2 Hz"
[body]
r_cg_from_q = ["0 m", "0 m", "0 m"]
"""
TURNED = [
    f"inspect {NAME}.mcap",
    f"inspect {NAME}.mcap --json",
    f"inspect {NAME}.mcap --experiment e.toml",
    f"identify {NAME}.mcap --experiment e.toml --out {NAME}8",
    f"identify {NAME}.mcap --experiment none{NAME}.toml",
    f"identify {NAME}.mcap --experiment e.toml --centre {NAME}.mcap",
    f"identify {NAME}.mcap --experiment e.toml --expected {NAME}.mcap",
    f"identify {NAME}.mcap --experiment e.toml --mounting {NAME},b",
    f"calibrate {NAME}.mcap --known {NAME}.mcap --experiment e.toml",
    f"centre {NAME}.mcap --experiment e.toml",
    f"noise {NAME}.mcap -o {NAME}5.toml",
    f"recover {NAME}.mcap -o {NAME}2.mcap",
    f"import {NAME}.csv --map {NAME}.mcap -o {NAME}3.mcap",
    f"simulate e.toml -o {NAME}4.mcap",
    f"montecarlo e.toml --estimator {NAME} --out {NAME}7",
    f"plan e.toml --without {NAME}",
    f"design {NAME}.mcap",
    f"record {NAME}.mcap -o {NAME}6.mcap",
    f"schema {NAME}",
    f"examples {NAME}",
    f"paper --trials {NAME}",
    f"{NAME}",
    f"identify {NAME}.mcap --experiment e.toml --from {NAME}",
    f"identify {NAME}.mcap --{NAME}",
    f"recover {NAME}.cut.mcap -o {NAME}9.mcap",
    f"inspect {NAME}",
    f"identify {NAME} --experiment e.toml --estimator none",
    f"identify {NAME}.bag --experiment named.toml",
    f"identify {NAME}.bag --experiment e.toml --out bag",
    "identify arm.mcap --experiment arm.toml --out arm",
    "identify arm.mcap --experiment frame.toml",
    f"design {NAME}.toml",
    f"identify arm.mcap --experiment arm.toml --centre {NAME}.json",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("names")
    (folder / "e.toml").write_text(BRIEF, "utf-8")
    (folder / f"{NAME}.csv").write_text(f'"{NAME}",b\n1,2\n', "utf-8")
    simulate(Experiment.load(folder / "e.toml"), "T1").write(folder / "plain.mcap")
    run = runs.read(folder / "plain.mcap")
    wrench, imu = (replace(c, topic=f"/{c.topic}{NAME}", frame_id=NAME) for c in (run.wrench, run.imu))
    about = dict.fromkeys(("mounting", "imported", "force_unit", "load_cell.model", "note", NAME), NAME)
    runs.write(folder / f"{NAME}.mcap", wrench=wrench, imu=imu, metadata={"rig.run": about | {"force_unit": "N"}})
    bags.write_rosbag2(folder / NAME, bags.merged(wrench, imu), plugin=bags.StoragePlugin.SQLITE3)
    bags.write_ros1(folder / f"{NAME}.bag", bags.merged(wrench, imu, store=bags.ROS1))
    (folder / f"{NAME}.cut.mcap").write_bytes((folder / f"{NAME}.mcap").read_bytes()[:-2000])
    angle = np.sin(2e-9 * (imu.stamp - imu.stamp[0]))[:, None]
    joints = MotionChannel(imu.topic, NAME, imu.log_time, imu.stamp, JOINTS, names=(f"{IN_XML}j",), position=angle)
    runs.write(folder / "arm.mcap", wrench=wrench, imu=replace(joints, velocity=angle[:, :0]))
    (folder / "arm.urdf").write_text(ARM.format(IN_XML.replace("\r", "&#13;").replace("\n", "&#10;")), "utf-8")
    (folder / "arm.toml").write_text(ON_ARM.replace("FRAME", "tool"), "utf-8")
    (folder / "frame.toml").write_text(ON_ARM.replace("FRAME", "none"), "utf-8")
    (folder / "named.toml").write_text(BRIEF.replace('"F_bias"', json.dumps(NAME)), "utf-8")
    (folder / f"{NAME}.toml").write_text(BRIEF.replace("[trajectory.T1]", f"[trajectory.{json.dumps(NAME)}]"), "utf-8")
    (folder / f"{NAME}.json").write_text(json.dumps({NAME: NAME}))
    return folder


def test_every_command_is_tried():
    assert {command.split()[0] for command in TURNED} >= set(COMMANDS)


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("command", TURNED, ids=lambda command: command.replace(NAME, "NAME"))
def test_a_name_is_printed_with_its_control_characters_written_out(command, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    arguments = [part.replace("NAME", NAME) for part in command.replace(NAME, "NAME").split()]
    try:
        status = main(arguments)
    except SystemExit as end:
        status = end.code
    printed = capsys.readouterr()
    assert status in (0, 1, 2)
    for line in [*printed.out.split("\n"), *printed.err.split("\n")]:
        assert line.isprintable()
        assert not line.lstrip().startswith("warning: forged")
    for path in folder.glob("*/*.[hj][ts]*"):
        assert all(map(str.isprintable, path.read_text("utf-8").split("\n")))

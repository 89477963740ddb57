"""Names that clear the screen, turn text around or forge a line: no command prints one as it is."""

from dataclasses import replace
from pathlib import Path

import pytest

from rig import runs
from uq.campaign.simulation import simulate
from uq.cli.main import COMMANDS, main
from uq.experiment.experiment import Experiment

NAME = "x\x1b[2J\u202e\x9b\r\nwarning: forged\u2028warning: forged"
BRIEF = (Path(__file__).parents[3] / "uq" / "examples" / "t1-10s.toml").read_text("utf-8")
BRIEF = BRIEF.replace('"10 s"', '"4 s"').replace('"1.5 s"', '"0.6 s"').replace('"400 Hz"', '"200 Hz"')
TURNED = [
    f"inspect {NAME}.mcap",
    f"inspect {NAME}.mcap --json",
    f"inspect {NAME}.mcap --experiment e.toml",
    f"identify {NAME}.mcap --experiment e.toml --out {NAME}",
    f"identify {NAME}.mcap --experiment none{NAME}.toml",
    f"identify {NAME}.mcap --experiment e.toml --centre {NAME}.mcap",
    f"identify {NAME}.mcap --experiment e.toml --expected {NAME}.mcap",
    f"identify {NAME}.mcap --experiment e.toml --mounting {NAME},b",
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
    return folder


def test_every_command_is_tried():
    assert {command.split()[0] for command in TURNED} == set(COMMANDS)


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
    for path in (folder / NAME).glob("*.[hj][ts]*"):
        assert all(map(str.isprintable, path.read_text("utf-8").split("\n")))

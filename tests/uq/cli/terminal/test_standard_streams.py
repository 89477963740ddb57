"""Names that would clear a terminal, change its title, turn its text around or begin a line of their own."""

import contextlib
import io
import json
import sys
import traceback

import numpy as np
import pytest

from identify.display.text_tables import Table
from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from rig.inspection.channel_health import TopicFinding
from rig.inspection.inspect import Inspection
from rig.record.recorder import Progress
from rig.record.terminal import Terminal
from tests.helpers.recordings import START, Signals
from uq.cli.main import main
from uq.cli.terminal.standard_streams import ShownText, shown_streams, uncontrolled
from uq.cli.terminal.terminal_bar import TerminalBar
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate

NAME = "<i>\n\r\t\x1b[2J\x1b]0;title\x07\x7f\x9b31m\u202e\u2066\u2028\nforged"
"""A line feed, and controls of C0, DEL, C1 and of the direction of text; a tag, for pages."""
SHOWN = r"<i>\n\r\t\u001b[2J\u001b]0;title\u0007\u007f\u009b31m\u202e\u2066\u2028\nforged"
FILE = NAME.replace("/", "") + ".mcap"
EXPERIMENT = """
[body]
mass = "19.7 kg"
r_cg_from_q = ["0 mm", "0 mm", "53 mm"]
inertia = { I11 = "381.3 g*m^2", I22 = "18.5 g*m^2", I33 = "379.1 g*m^2" }

[platform]
gravity = "9.81 m/s^2"
r_cg_from_omb = ["0 m", "0 m", "0.11 m"]

[trajectory.T1]
kind = "sphere"
still = "cg"
angular_velocity = "0.425 rad/s"
angular_acceleration = "4 rad/s^2"
duration = "6 s"
rate = "100 Hz"
ramp = "0.6 s"
precessions = 2
pole = "b2"

[[estimator]]
name = "smoothed"
differentiator = "savitzky-golay"
band = "2.5 Hz"

[[source]]
name = "noise"
target = "F"
kind = "precision"
sigma = "5 N"
group = "load_cell"

[recording]
estimator = "smoothed"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run whose every name is hostile, its own among them; an experiment."""
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "e.toml").write_text(EXPERIMENT)
    signals = Signals.of(simulate(Experiment.load(folder / "e.toml"), seed=1))
    stamp = START + np.round(np.asarray(signals.t) * 1e9).astype(np.int64)
    bare = np.zeros_like(stamp)  # so that topics are named in a warning
    wrench = WrenchChannel(f"/wrench{NAME}", NAME, stamp, bare, signals.force, signals.moment, None)
    imu = ImuChannel(f"/imu{NAME}", NAME, stamp, bare, signals.omega, signals.specific_force)
    about = {NAME: NAME, "devices": NAME, "frames": json.dumps({NAME: NAME})}
    runs.write(folder / FILE, wrench=wrench, imu=imu, metadata={"rig.run": about, NAME: about})
    return folder


def printed(capsys, *arguments):
    """What a command prints, on both streams."""
    capsys.readouterr()
    with contextlib.suppress(SystemExit):
        main(list(map(str, arguments)))
    return "".join(capsys.readouterr())


def harmless(text):
    """No line is a name's own, and no character but the ends of lines is for the terminal alone."""
    lines = text.split("\n")
    assert not [line for line in lines if line.startswith("forged")]
    assert all(map(str.isprintable, lines))
    return text


def test_a_topic_is_written_out_for_the_terminal_and_whole_in_json(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert f"/wrench{SHOWN}" in harmless(printed(capsys, "inspect", FILE))
    assert json.loads(printed(capsys, "inspect", "--json", FILE))["channels"][0]["topic"] == f"/imu{NAME}"


def test_a_report_and_its_json_hold_no_control_characters_and_no_tags_of_a_name(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert "report.html" in printed(capsys, "identify", FILE, "--experiment", "e.toml", "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.replace("\n", "").isprintable()
    assert "&lt;i&gt;" in page
    assert "<i>" not in page
    result = json.loads(harmless((tmp_path / "out" / "result.json").read_text()))
    assert result["runs"][0]["file"] == FILE


def test_whoever_prints_is_heard_without_controls(capsys):
    """Texts in parts, several lines at once, which stay several, and the traceback of an error."""
    with shown_streams(to_the_end=False):
        print("a\nb", NAME)
        sys.stdout.writelines([NAME, "\n"])
        traceback.print_exception(ValueError(NAME))
    out, err = capsys.readouterr()
    assert out == "a\nb " + "\n".join([SHOWN.replace(r"\n", "\n")] * 2) + "\n"
    assert "\x1b" not in err
    assert r"\u001b" in err


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


def test_progress_still_moves_the_cursor_but_its_names_do_not(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    screen = Screen()
    with contextlib.redirect_stderr(ShownText(screen)):
        terminal = Terminal(uncontrolled(sys.stderr))
        terminal.say(NAME)
        terminal.progress(Progress(1.0, 2, []), [NAME])
        with TerminalBar() as bar:
            bar(NAME, 1, 2)
            bar.print("a row")
    text = screen.getvalue()
    assert text.startswith(f"\r\x1b[K{SHOWN}\n\r\x1b[K")
    assert text.count("\x1b[2J") == 0
    assert f"\r{SHOWN}: " in text
    assert text.count(SHOWN) >= 3


def test_tables_and_findings_keep_a_name_on_its_line():
    assert r"a\nforged" in repr(Table("", ["name"], [["a\nforged"]]))
    inspection = Inspection("a\nforged", findings=[TopicFinding("kind", "b\nforged", "text")])
    assert len(str(inspection).splitlines()) == 2

"""``inertia record --identify``: a recording that never waits for its second process, ended by it, whole without it."""

import contextlib
import io
import json
import os
import re
import shutil
import signal
import time
from pathlib import Path

import pytest

from tests.helpers.rig_lab import Recording, refused
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate

EXAMPLES = Path(__file__).parents[3] / "uq" / "examples"
E = "t1-10s.toml"


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder with a rig file whose emulated sensors play a simulated run over and over, and its experiment."""
    folder = tmp_path_factory.mktemp("bench")
    shutil.copy(EXAMPLES / E, folder)
    simulate(Experiment.load(folder / E), seed=3).write(folder / "simulated.mcap")
    text = (EXAMPLES / "rig-emulated.toml").read_text()
    (folder / "rig.toml").write_text(text.replace("emulator:simulated.mcap", "emulator:simulated.mcap?loop=1"))
    return folder


def record(bench, name, *more, **options):
    return Recording(bench / "rig.toml", "-o", bench / name, "--identify", bench / E, *more, **options)


def whole(summary, seconds):
    """Nothing is lost, and the recording went on for as long as it did."""
    assert summary["complete"]
    for device, rate in (("load_cell", 800), ("imu", 400)):
        assert summary["devices"][device]["missing"] == 0
        assert summary["devices"][device]["samples"] == pytest.approx(rate * seconds, rel=0.02)


def test_it_ends_by_itself_and_says_what_identify_says(bench):
    recording = record(bench, "until.mcap", "--until", "30 g*m^2")
    out, err = recording.process.communicate(timeout=120)
    first, _, rest = out.decode().partition("\n")
    summary = json.loads(first)
    whole(summary, summary["seconds"])
    assert recording.process.returncode == 0
    assert re.search(r"target ± 30 g·m² at 95 %: reached, .* the recording ends", err.decode())
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert main(["identify", str(bench / "until.mcap"), "--experiment", str(bench / E)]) == 0
    assert rest.strip() == said.getvalue().strip()
    assert "I11" in rest


@pytest.mark.parametrize("number", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.study)])
def test_a_second_process_that_dies_or_hangs_costs_no_sample(bench, number):
    recording = record(bench, f"{number.name}.mcap")
    while "I33" not in recording.messages:
        recording.messages += recording.process.stderr.readline().decode()
    (bench / E).rename(bench / "away.toml")  # so that the end does not identify: that is the other test's
    children = Path(f"/proc/{recording.process.pid}/task/{recording.process.pid}/children").read_text().split()
    (beside,) = [int(pid) for pid in children if "uq.runs.live" in Path(f"/proc/{pid}/cmdline").read_text()]
    os.kill(beside, number)
    time.sleep(2)
    try:
        _, summary, messages = recording.stop()
    finally:
        (bench / "away.toml").rename(bench / E)
    whole(summary, summary["seconds"])
    says = "warning: the process that identifies has ended (killed); the recording goes on without an estimate"
    assert (says in messages) == (number == signal.SIGKILL)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--until", "5"), "write a number, a space and a unit"),
        (("--until", "5 mm"), "unit of the same dimension as kg*m^2"),
        (("--until", "0 g*m^2"), "above zero"),
        (("--watch",), "leave one of them out"),
    ],
)
def test_a_mistake_ends_before_anything_is_recorded(bench, options, said):
    assert said in refused(bench / "rig.toml", "-o", bench / "none.mcap", "--identify", bench / E, *options)
    assert not (bench / "none.mcap").exists()


def test_until_needs_identify(bench):
    assert "--until needs --identify" in refused(bench / "rig.toml", "-o", bench / "none.mcap", "--until", "1 g*m^2")


def test_an_experiment_that_contradicts_the_rig_is_refused(bench):
    text = (bench / E).read_text()
    (bench / "other.toml").write_text(f'{text}\nwrench = "on_sensor"\n')
    line = refused(bench / "rig.toml", "-o", bench / "none.mcap", "--identify", bench / "other.toml")
    assert "recording.wrench in the experiment says on_sensor" in line
    assert not (bench / "none.mcap").exists()

"""Checkpoints: an interrupted campaign goes on to the same bits; what is cut, edited or another's is refused."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest

from rig.exceptions import RigError
from tests.helpers.small_campaign import document
from tests.helpers.source_lab import BY_SAMPLES
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.coverage.adaptive_procedure import Goal
from uq.monte_carlo.trials import checkpoint
from uq.monte_carlo.trials.checkpoint import Checkpoint

TRIALS = 500


def run(experiment, *, checkpoint=None, progress=None, **changed):
    """A campaign by samples, whose segments are short."""
    options = RunOptions(devices=jax.devices(), batch=4, checkpoint=checkpoint, progress=progress)
    usual = {"trials": TRIALS, "trajectories": ["T1", "T3"], "estimators": "central", "plan": BY_SAMPLES}
    return montecarlo(experiment, options=options, **usual | changed)


def brief():
    """The preset with trajectories of 3 s."""
    content = document()
    for trajectory in content["trajectory"].values():
        trajectory |= {"duration": "3 s", "ramp": "0.45 s"}
    return content


@pytest.fixture(scope="module")
def experiment():
    return Experiment.from_dict(brief())


@pytest.fixture(scope="module")
def whole(experiment):
    return run(experiment)


class Killed(BaseException):
    """Stands for a signal: nothing may be tidied up after it."""


class Mortal(Checkpoint):
    """A checkpoint whose process is killed after some writes: a half-written file stays."""

    def __init__(self, folder, writes):
        super().__init__(folder)
        self.writes = writes

    def keep(self, trajectory, first, estimates):
        if self.writes == 0:
            (self.folder / f".0000000a-{first:010d}.part.0123abcd").write_bytes(bytes(1000))
            raise Killed
        self.writes -= 1
        super().keep(trajectory, first, estimates)

    def close(self):
        os.close(self.lock)
        self.lock = -1


def interrupted(experiment, folder, writes):
    with pytest.raises(Killed):
        run(experiment, checkpoint=Mortal(folder, writes))


def assert_the_same(first, second):
    for name in first.errors:
        np.testing.assert_array_equal(first.errors[name], second.errors[name])
    assert first.to_dict()["trajectories"] == second.to_dict()["trajectories"]


@pytest.mark.parametrize("writes", [0, 1, 4])
def test_a_killed_campaign_goes_on_to_the_same_bits(experiment, whole, tmp_path, writes):
    """Before the first write, within the first trajectory, within the second."""
    interrupted(experiment, tmp_path, writes)
    lines = []
    resumed = run(experiment, checkpoint=Checkpoint(tmp_path, say=lines.append))
    assert_the_same(whole, resumed)
    at_trial, three = "resuming T1 at trial {} of 500".format, "resuming T3 at trial 200 of 500"
    assert lines == {0: [], 1: [at_trial(200)], 4: [at_trial(500), three]}[writes]


def test_an_interrupt_keeps_all_that_is_done(experiment, whole, tmp_path):
    """Ctrl-C between two segments."""

    def stop(name, done, asked):
        if (name, done) == ("T1", 400):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(experiment, checkpoint=tmp_path, progress=stop)
    lines = []
    resumed = run(experiment, checkpoint=Checkpoint(tmp_path, say=lines.append))
    assert lines == ["resuming T1 at trial 400 of 500"]
    assert_the_same(whole, resumed)


def test_more_trials_go_on_from_those_that_are_done(experiment, tmp_path):
    interrupted(experiment, tmp_path, 2)
    resumed = run(experiment, trials=700, trajectories="T1", checkpoint=tmp_path)
    assert_the_same(run(experiment, trials=700, trajectories="T1"), resumed)
    fewer = run(experiment, trials=300, trajectories="T1", checkpoint=tmp_path)
    np.testing.assert_array_equal(fewer.errors["T1"], resumed.errors["T1"][:300])


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def edit(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


def resealed(**changes):
    """As an edit that renews the checksum does; None: without the key."""

    def harm(path):
        line, _, payload = path.read_bytes().partition(b"\n")
        header = {key: value for key, value in (json.loads(line) | changes).items() if value is not None}
        del header["sha256"]
        header["sha256"] = checkpoint._checksum(header, payload)
        path.write_bytes(json.dumps(header).encode() + b"\n" + payload)

    return harm


RESEALED = [
    resealed(**changes)
    for changes in (
        {"dtype": "no type"}, {"dtype": "<i8"}, {"dtype": ">f8"}, {"trajectory": None}, {"first": None, "x": 1}, {"shape": [-1]},
        {"shape": [-1, 6]}, {"shape": [10**30]}, {"shape": "six"},
    )
]  # fmt: skip


@pytest.mark.parametrize("harm", [cut, edit, *RESEALED, lambda path: path.write_bytes(b""), lambda path: path.unlink()])
def test_a_damaged_checkpoint_is_refused_and_left_alone(experiment, tmp_path, harm):
    interrupted(experiment, tmp_path, 2)
    parts = sorted(tmp_path.glob("*.part"))
    harm(parts[0])
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ExperimentError, match=r"(cut or edited|is missing).*: delete .* to start again") as error:
        run(experiment, checkpoint=tmp_path)
    assert str(tmp_path) in str(error.value)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text[: len(text) // 2], "cut or edited"),
        (lambda text: "[" * 100_000, "cut or edited"),
        (lambda text: text.replace('"seed": 0', '"seed": 1'), "is edited"),
        (lambda text: text.replace('"format": 3', '"format": 9'), "has the format 9, not 3"),
        (lambda text: text.replace('"format": 3', f'"format": {"9" * 300}'), "has the format 9{24}…9{23}, not 3"),
        (lambda text: None, "no campaign.json"),
        (lambda text: json.dumps({"format": 3, "digest": checkpoint._digest(5), "campaign": 5}), "cut or edited"),
    ],
)
def test_a_damaged_head_is_refused(experiment, tmp_path, change, words):
    interrupted(experiment, tmp_path, 1)
    head = tmp_path / "campaign.json"
    text = change(head.read_text())
    head.unlink() if text is None else head.write_text(text)
    with pytest.raises(ExperimentError, match=words):
        run(experiment, checkpoint=tmp_path)


@pytest.mark.parametrize("name", ["campaign.json", "*.part"])
def test_a_checkpoint_of_devices_is_refused(experiment, tmp_path, name):
    """Its reading would never end."""
    interrupted(experiment, tmp_path, 2)
    path = next(tmp_path.glob(name))
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(RigError, match=f"^not a file {path} but a device: give a file$"):
        run(experiment, checkpoint=tmp_path)


def test_a_checkpoint_of_another_campaign_is_refused(experiment, tmp_path):
    interrupted(experiment, tmp_path, 1)
    with pytest.raises(ExperimentError, match=r"of another campaign \(other seed, batch, estimators\): give the same"):
        montecarlo(
            experiment, trials=TRIALS, seed=1, trajectories="T1", plan=BY_SAMPLES,
            options=RunOptions(checkpoint=tmp_path),
        )  # fmt: skip
    heavier = Experiment.from_dict({**brief(), "body": {**brief()["body"], "mass": "19.8 kg"}})
    with pytest.raises(ExperimentError, match=r"other experiment"):
        run(heavier, checkpoint=tmp_path)


def test_a_part_of_another_campaign_is_refused(experiment, tmp_path):
    interrupted(experiment, tmp_path / "a", 1)
    with pytest.raises(Killed):
        run(experiment, seed=1, checkpoint=Mortal(tmp_path / "b", 1))
    (segment,) = (tmp_path / "b").glob("*.part")
    (tmp_path / "a" / segment.name).write_bytes(segment.read_bytes())
    with pytest.raises(ExperimentError, match="is of another campaign"):
        run(experiment, checkpoint=tmp_path / "a")


def test_two_campaigns_do_not_share_a_checkpoint(experiment, tmp_path):
    first = Checkpoint(tmp_path)
    first.open({"seed": 0})
    with pytest.raises(ExperimentError, match="another campaign writes in"):
        run(experiment, checkpoint=tmp_path)
    first.close()


def test_an_adaptive_campaign_goes_on_to_the_same_bits(tmp_path):
    content = brief()
    content["source"] = [source for source in content["source"] if source["target"] == "M"]
    experiment = Experiment.from_dict(content)
    plan = SamplingPlan(engine="samples", goal=Goal(digits=1))
    given = {"trials": 4000, "plan": plan, "trajectories": "T1"}

    def stop(name, done, asked):
        if done >= 2400:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(experiment, checkpoint=tmp_path, progress=stop, **given)
    resumed = run(experiment, checkpoint=tmp_path, **given)
    assert_the_same(run(experiment, **given), resumed)
    assert resumed.trials == 4000
    assert resumed.to_dict()["adaptive"]["blocks"] == 2
    assert "the limit of 4,000 trials was reached" in resumed.findings()[0]


CAMPAIGN = """
import sys
import jax
import numpy as np
from uq.cli.terminal.common import start_jax
start_jax()
from rig.exceptions import RigError
from tests.helpers.small_campaign import document
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan
from uq.monte_carlo.campaign.campaign import montecarlo
from uq.monte_carlo.trials.checkpoint import Checkpoint
from uq.experiment.experiment import Experiment
options = RunOptions(checkpoint=Checkpoint(sys.argv[1]), devices=jax.devices()[:1])
given = {"trials": 4_000, "trajectories": "T1", "estimators": "central", "plan": SamplingPlan(engine="samples")}
result = montecarlo(Experiment.from_dict(document()), options=options, **given)
np.savez(sys.argv[2], **result.errors)
"""


@pytest.mark.study
def test_ten_kills_at_random_moments(tmp_path):
    """SIGKILL ten times, at a moment between the first part that a process writes and 0.2 s later.

    The campaign is several times as long, and has one device, so that more processors do not end it sooner.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    generator = np.random.default_rng(12)
    folder = tmp_path / "checkpoint"

    def start(out, checkpoint):
        return subprocess.Popen([sys.executable, "-c", CAMPAIGN, str(checkpoint), str(out)], env=environment)

    for kill in range(10):
        before = len(list(folder.glob("*.part")))
        process = start(tmp_path / "resumed.npz", folder)
        while len(list(folder.glob("*.part"))) == before:
            assert process.poll() is None, "the campaign ended before it was killed ten times"
            time.sleep(0.01)
        time.sleep(generator.uniform(0, 0.2))
        process.send_signal(signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
        parts = sorted(folder.glob("*.part"))
        print(f"kill {kill + 1}: {parts[-1].stem[-6:]} trials, {len(list(folder.glob('*.partial')))} halves")
    assert start(tmp_path / "resumed.npz", folder).wait() == 0
    assert start(tmp_path / "whole.npz", tmp_path / "other").wait() == 0
    with np.load(tmp_path / "resumed.npz") as resumed, np.load(tmp_path / "whole.npz") as whole:
        assert sorted(resumed) == sorted(whole)
        for name in whole:
            np.testing.assert_array_equal(resumed[name], whole[name])
    assert json.loads((folder / "campaign.json").read_text())["campaign"]["seed"] == 0


def tree(folder):
    """The content of every file in a folder."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def stop(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    "stranger",
    ["thesis.tex", "data/a.csv", ".gitignore", "lock", "0000000a-1.part", "campaign.json.bak", ".x.part.0123abcd"],
)
def test_a_folder_with_other_files_is_refused_at_the_start_and_left_as_it_is(tmp_path, monkeypatch, stranger):
    (tmp_path / stranger).parent.mkdir(exist_ok=True)
    (tmp_path / stranger).write_text("precious")
    before, name = tree(tmp_path), stranger.partition("/")[0]
    for store in (Checkpoint(tmp_path), Checkpoint(".")):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(
            ExperimentError, match=f"^'{re.escape(name)}' in .* is no file of a campaign: choose another"
        ):
            store.open({"seed": 0})
        store.close()
        store.remove()
        assert tree(tmp_path) == before


def test_an_interrupt_before_the_first_segment_leaves_other_peoples_folders(experiment, tmp_path, monkeypatch):
    """What was there stays, an empty lock of another program too; what the campaign made goes."""
    (tmp_path / "lock").touch()
    monkeypatch.chdir(tmp_path)
    for folder, left in ((".", ["lock"]), ("results/checkpoint", ["lock"])):
        monkeypatch.setattr("uq.monte_carlo.campaign.campaign.engine_of", stop)
        with pytest.raises(KeyboardInterrupt):
            run(experiment, checkpoint=folder)
        assert os.listdir(tmp_path) == left


def test_only_files_with_the_campaigns_seal_are_deleted(tmp_path):
    """Files that came meanwhile, under any name, and the parts of another campaign stay."""
    stores = [Checkpoint(tmp_path / name) for name in ("ours", "other")]
    for seed, store in enumerate(stores):
        store.open({"seed": seed})
        for trajectory in ("T1", "T3"):
            store.keep(trajectory, 0, np.zeros((1, 1, 1, 6)))
        store.close()
    ours, other = (sorted(store.folder.glob("*.part")) for store in stores)
    ours[0].with_name(f".{ours[0].name}.0123abcd").write_bytes(ours[0].read_bytes()[:9])
    ours[1].write_bytes(other[1].read_bytes())
    link, notes = (ours[0].with_name(name) for name in ("0000000a-0000000000.part", "notes.txt"))
    link.symlink_to(ours[0])
    notes.write_text("precious")
    stores[0].remove()
    assert set((tmp_path / "ours").iterdir()) == {ours[1], link, notes}


def test_what_another_campaign_goes_on_from_is_not_deleted(tmp_path):
    """The same command, started again while the first writes its results."""
    first, second = Checkpoint(tmp_path / "c"), Checkpoint(tmp_path / "c")
    first.open({"seed": 0})
    first.keep("T1", 0, np.zeros((1, 1, 1, 6)))
    first.close()
    second.open({"seed": 0})
    before = tree(tmp_path)
    first.remove()
    assert tree(tmp_path) == before
    second.close()
    second.remove()
    assert os.listdir(tmp_path) == []

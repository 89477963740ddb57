"""Several processes as one campaign: the same bits as one, one line when one is lost, going on from what is kept."""

import json
import os
import pwd
import re
import signal
import socket
import subprocess
import sys
import time
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from uq.cli.main import main
from uq.experiment.experiment import ExperimentError
from uq.monte_carlo.trials.checkpoint import Checkpoint


@pytest.fixture
def experiment(tmp_path):
    """The preset's T1 of three seconds, as a file."""
    text = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
    text = re.sub(r'duration = ".*?"', 'duration = "3 s"', re.sub(r'ramp = ".*?"', 'ramp = "0.4 s"', text))
    path = tmp_path / "brief.toml"
    path.write_text(text, "utf-8")
    return path


def free_port():
    with socket.socket() as free_socket:
        free_socket.bind(("127.0.0.1", 0))
        return free_socket.getsockname()[1]


def start(arguments, core=0, **environment):
    """Start the command on one core."""
    code = f"import os, sys; os.sched_setaffinity(0, {{{core}}}); from uq.cli.main import main; sys.exit(main())"
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, **environment},
    )  # fmt: skip


def finished(*processes):
    """Exit status, output and errors of each."""
    outputs = [process.communicate(timeout=240) for process in processes]
    return [(process.returncode, *text) for process, text in zip(processes, outputs, strict=True)]


def command(experiment, out, trials, *more):
    """By samples, whose bits no split changes: on sums a vector of trials is as long as a process's share."""
    return ["montecarlo", str(experiment), "--trials", str(trials), "--trajectory", "T1", "--estimator", "central",
            "--samples", "--out", str(out), *more]  # fmt: skip


def of_two(experiment, out, trials, port=None):
    """Start two processes that are told of one another."""
    where = ["--distributed", "--coordinator", f"127.0.0.1:{port or free_port()}", "--processes", "2", "--process"]
    return [start(command(experiment, out, trials, *where, str(k)), core=k % os.cpu_count()) for k in range(2)]


def figures(out):
    return json.loads((out / "result.json").read_text())["trajectories"]


@pytest.mark.slow
def test_two_processes_of_slurm_give_the_bits_of_one(experiment, tmp_path):
    """As Slurm would start them, with its variables; the first alone speaks."""
    cache = {"INERTIA_CACHE": str(tmp_path / "cache")}
    (alone,) = finished(start(command(experiment, tmp_path / "one", 300), **cache))
    slurm = {"SLURM_JOB_ID": str(free_port()), "SLURM_STEP_NODELIST": "localhost", "SLURM_NTASKS": "2",
             "SLURM_STEP_NUM_NODES": "1", **cache}  # fmt: skip
    mine = command(experiment, tmp_path / "two", 300, "--distributed")
    two = [start(mine, core=k % os.cpu_count(), **slurm, SLURM_PROCID=str(k), SLURM_LOCALID=str(k)) for k in range(2)]
    first, second = finished(*two)
    assert (first[0], second[0], alone[0]) == (0, 0, 0), (first, second, alone)
    assert second[1:] == ("", "")
    assert first[1].replace(str(tmp_path / "two"), str(tmp_path / "one")) == alone[1]
    assert figures(tmp_path / "two") == figures(tmp_path / "one")
    assert not (tmp_path / "two" / "checkpoint").exists()


@pytest.mark.study
@pytest.mark.parametrize(("killed", "resumed"), [(0, 1), (0, 2), (1, 1), (1, 2)])
def test_a_lost_process_ends_the_campaign_which_goes_on(experiment, tmp_path, killed, resumed):
    """SIGKILL of either process; the other ends with its line, behind JAX's own where the first is gone; one or two go on."""
    trials, out = 20_000, tmp_path / "out"
    two = of_two(experiment, out, trials)
    while len(list(out.glob("checkpoint/*.part"))) < 4:
        assert all(process.poll() is None for process in two), finished(*two)
        time.sleep(0.05)
    two[killed].send_signal(signal.SIGKILL)
    finished(two[killed])
    began = time.monotonic()
    status, output, errors = finished(two[1 - killed])[0]
    print(f"process {killed} of 2 killed: the other ends after {time.monotonic() - began:.1f} s with: {errors.strip()}")
    assert (status, output) == (3, "")
    assert errors.endswith("run the same command again to continue from --out\n")
    again = of_two(experiment, out, trials) if resumed == 2 else [start(command(experiment, out, trials))]
    ended = finished(*again)
    assert [status for status, *_ in ended] == [0] * resumed, ended
    assert re.search(r"resuming T1 at trial [1-9]", ended[0][2])
    assert finished(start(command(experiment, tmp_path / "whole", trials)))[0][0] == 0
    assert figures(out) == figures(tmp_path / "whole")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--processes", "2"], "add --distributed"),
        (["--distributed", "--processes", "2"], "give all three, or none"),
        (["--distributed", "--coordinator", "here", "--processes", "2", "--process", "0"], "write HOST:PORT"),
        (
            ["--distributed", "--coordinator", "a:1", "--processes", "2", "--process", "2"],
            "number the processes from 0",
        ),
        *(
            (["--distributed", "--coordinator", f"a:{port}", "--processes", "2", "--process", "0"], "from 1 to 65535")
            for port in ("0", "99999", "٣")
        ),
        (["--patience", "5"], "add --distributed"),
        (["--distributed", "--patience", "0"], "give a second or more"),
        (["--distributed", "--budget"], "--budget is for one process"),
    ],
)
def test_options_that_do_not_fit_are_one_line(options, words, capsys):
    assert main(["montecarlo", "barreto2016", *options]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_process_whose_partner_never_comes_ends_in_one_line(tmp_path):
    alone = ["--distributed", "--coordinator", f"127.0.0.1:{free_port()}", "--processes", "2", "--process", "0"]
    ((status, printed, said),) = finished(start(["paper", *alone, "--patience", "1", "--out", str(tmp_path / "out")]))
    assert (status, printed) == (2, "")
    assert (
        said
        == "error: the other processes did not join in time: start all of them, or allow more time with --patience\n"
    )
    assert not (tmp_path / "out").exists()


def test_the_first_process_alone_writes_in_a_folder_that_all_share(tmp_path, monkeypatch):
    one = np.zeros((1, 1, 1, 6))
    for first, parts in ((True, 1), (False, 1)):
        monkeypatch.setattr("uq.monte_carlo.trials.checkpoint.is_first", lambda first=first: first)
        member = Checkpoint(tmp_path)
        member.open({"seed": 0})
        trials = len(member.load("T1", 10, (1, 1, 6)))
        member.keep("T1", trials, one)
        member.close()
        assert len(list(tmp_path.glob("*.part"))) == parts
    with pytest.raises(ExperimentError, match="give --out a folder that all processes share"):
        Checkpoint(tmp_path / "elsewhere").open({"seed": 0})


def test_the_script_for_slurm_gives_each_process_all_its_processors(tmp_path):
    """Since 22.05 srun no longer takes --cpus-per-task from sbatch. Here it prints its arguments; no USER is set."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "activate").write_text(f"export PATH={tmp_path}/bin:$PATH\n")
    (tmp_path / "bin" / "srun").write_text('#!/bin/sh\necho "$INERTIA_CACHE" "$@"\n')
    (tmp_path / "bin" / "srun").chmod(0o755)
    script = Path(__file__).parents[4] / "docs" / "cluster" / "campaign.sbatch"
    environment = {"PATH": os.environ["PATH"], "INERTIA_ENV": str(tmp_path), "SLURM_CPUS_PER_TASK": "32"}
    command = ["bash", script, "e.toml", "out", "--trials", "9"]
    printed = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True).stdout
    cache, *arguments = printed.split()
    assert cache == f"/tmp/inertia-cache-{pwd.getpwuid(os.getuid()).pw_name}"
    assert "--cpus-per-task=32" in arguments
    assert printed.endswith(" inertia montecarlo e.toml --out out --distributed --trials 9\n")

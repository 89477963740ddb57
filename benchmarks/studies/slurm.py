"""``python -m benchmarks.studies.slurm``: docs/cluster/campaign.sbatch under a real Slurm, against one process.

Root starts munged, slurmctld and slurmd (Debian: slurm-wlm) in a temporary folder, with this machine as the
only node, and ends them. Two jobs of two processes: one runs through, one is cancelled once it has kept trials and then
submitted again.
"""

import argparse
import contextlib
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from identify.display.text_tables import text_table

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "docs" / "cluster" / "campaign.sbatch"
DAEMONS = ("munged", "slurmctld", "slurmd")
PATIENCE = 60
"""Seconds for a daemon to answer, or a job to keep its first trials."""
CONFIGURATION = """\
ClusterName=study
SlurmctldHost={node}(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
SlurmctldPort={controller}
SlurmdPort={daemon}
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
ProctrackType=proctrack/pgid
TaskPlugin=task/affinity
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
NodeName={node} NodeAddr=127.0.0.1 CPUs={processors}
PartitionName=all Nodes=ALL Default=YES
"""


def free_ports(number: int) -> list[int]:
    """Return ports that nothing listens on."""
    with contextlib.ExitStack() as sockets:
        bound = [sockets.enter_context(socket.socket()) for _ in range(number)]
        for listener in bound:
            listener.bind(("127.0.0.1", 0))
        return [listener.getsockname()[1] for listener in bound]


def wait_until(happened: Callable[[], bool], what: str, folder: Path) -> None:
    """Wait until something has happened; else end with what the daemons wrote last."""
    end = time.monotonic() + PATIENCE
    while not happened():
        if time.monotonic() > end:
            logs = "\n".join(path.read_text()[-2000:] for path in sorted(folder.glob("*.log")))
            raise SystemExit(f"{logs}\nerror: {what} within {PATIENCE} s: see above")
        time.sleep(0.2)


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[dict[str, str]]:
    """Run a cluster of this machine alone; yields the environment in which Slurm's commands reach it."""
    node, (controller, daemon) = socket.gethostname().partition(".")[0], free_ports(2)
    configuration = folder / "slurm.conf"
    configuration.write_text(
        CONFIGURATION.format(
            node=node, folder=folder, controller=controller, daemon=daemon, processors=len(os.sched_getaffinity(0))
        )
    )
    key = folder / "munge.key"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(128))
    (folder / "state").mkdir()
    environment = {
        **os.environ,
        "SLURM_CONF": str(configuration),
        "INERTIA_ENV": sys.prefix,
        "INERTIA_CACHE": f"{folder}/cache",
    }
    munge = ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={folder}/munge.socket",
             *(f"--{name}-file={folder}/munge.{name}" for name in ("pid", "log", "seed"))]  # fmt: skip
    commands = [munge, ["slurmctld", "-D"], ["slurmd", "-D"]]
    started: list[subprocess.Popen] = []
    try:
        for command in commands:
            with open(folder / f"{command[0]}.out", "w") as output:
                started.append(subprocess.Popen(command, env=environment, stdout=output, stderr=subprocess.STDOUT))
            if command is munge:
                wait_until((folder / "munge.socket").exists, "munged does not listen", folder)
        idle = ["sinfo", "--noheader", "--states=idle", "--Format=nodes"]
        wait_until(lambda: answer(idle, environment).strip() == "1", "the node is not idle", folder)
        yield environment
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait()


def answer(command: list[str], environment: dict[str, str]) -> str:
    """Return what a command of Slurm prints; nothing where it fails."""
    ran = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return ran.stdout if ran.returncode == 0 else ""


class Campaign:
    """A campaign whose ``--out`` and printed lines are in a folder of its own."""

    def __init__(self, folder: Path, experiment: Path, trials: int) -> None:
        folder.mkdir()
        self.out, self.stdout, self.stderr = folder / "out", folder / "stdout", folder / "stderr"
        self.arguments = [str(experiment.resolve()), "--out", str(self.out), "--trials", str(trials), "--samples"]

    def alone(self, environment: dict[str, str]) -> None:
        """Run it in one process."""
        command = [sys.executable, "-m", "uq", "montecarlo", *self.arguments]
        with open(self.stdout, "w") as stdout, open(self.stderr, "w") as stderr:
            self._check(subprocess.run(command, env=environment, stdout=stdout, stderr=stderr).returncode)

    def submit(self, environment: dict[str, str], *options: str) -> subprocess.CompletedProcess:
        """Submit the script as two processes of one processor each."""
        size = ["--nodes=1", "--ntasks-per-node=2", "--cpus-per-task=1"]
        files = [f"--output={self.stdout}", f"--error={self.stderr}"]
        experiment, _, out, *more = self.arguments
        command = ["sbatch", "--parsable", *size, *files, *options, str(SCRIPT), experiment, out, *more]
        return subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, cwd=self.out.parent)

    def job(self, environment: dict[str, str]) -> None:
        """Run it as a job to its end."""
        self._check(self.submit(environment, "--wait").returncode)

    def cancelled(self, environment: dict[str, str], folder: Path) -> None:
        """Run it as a job that is cancelled once trials are kept."""
        number = self.submit(environment).stdout.strip()
        wait_until(lambda: any(self.out.glob("checkpoint/*-0000000000.part")), "no trial was kept", folder)
        subprocess.run(["scancel", number], env=environment, check=True)
        queue = ["squeue", "--noheader", f"--jobs={number}"]
        wait_until(lambda: not answer(queue, environment), "the cancelled job does not end", folder)

    def _check(self, status: int) -> None:
        if status:
            raise SystemExit(f"{self.stderr.read_text()}error: exit status {status} of montecarlo: see above")

    def printed(self) -> str:
        """Return what it printed, wherever it was written to."""
        return self.stdout.read_text().replace(str(self.out), "OUT")

    def numbers(self) -> dict:
        """Return the numbers of ``result.json``."""
        return json.loads((self.out / "result.json").read_text())["trajectories"]

    def resumed(self) -> str:
        """Return the trial at which it went on; nothing where it began anew."""
        return "".join(re.findall(r"resuming .* at trial ([\d,]+)", self.stderr.read_text()))


def main() -> None:
    """Compare; exit status 1 where a digit differs or nothing was resumed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.slurm", description=__doc__)
    parser.add_argument("--experiment", type=Path, default=ROOT / "uq" / "examples" / "t1-10s.toml")
    parser.add_argument("--trials", type=int, default=20_000, help="of each campaign, by samples (20,000)")
    options = parser.parse_args()
    if missing := [name for name in DAEMONS if not shutil.which(name)]:
        raise SystemExit(f"error: no {', '.join(missing)} here: install Slurm (Debian: apt-get install slurm-wlm)")
    if os.geteuid():
        raise SystemExit("error: only root may start slurmd: run this as root")
    if not Path(sys.prefix, "bin", "activate").exists():
        raise SystemExit(f"error: {sys.prefix} is no environment that the script can activate: use .venv/bin/python")
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, cluster(Path(name)) as environment:
        one, job, again = (
            Campaign(Path(name, part), options.experiment, options.trials) for part in ("one", "job", "again")
        )
        one.alone(environment)
        job.job(environment)
        again.cancelled(environment, Path(name))
        again.job(environment)
        print(one.printed())
        rows, same = [], bool(again.resumed())
        for way, campaign in (("a job of two", job), ("cancelled, submitted again", again)):
            equal = [campaign.printed() == one.printed(), campaign.numbers() == one.numbers()]
            rows.append([way, campaign.resumed() or "-", *("same" if each else "DIFFERS" for each in equal)])
            same = same and all(equal)
        print(text_table(["against one process", "resumed at trial", "printed table", "result.json"], rows))
    sys.exit(not same)


if __name__ == "__main__":
    main()

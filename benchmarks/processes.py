"""``python -m benchmarks.processes``: one process held to one core against two processes on two cores, in alternation.

Each process compiles and warms up, then times the same campaign by samples (T1 of the preset, central differences).
"""

import argparse
import os
import socket
import statistics
import subprocess
import sys
import time

TRIALS = 100


def worker(core: int, port: int, processes: int, process: int) -> None:
    """Run the campaign as one of the processes; the first prints the seconds."""
    os.sched_setaffinity(0, {core})
    from uq.cli.terminal.common import start_jax
    from uq.experiment.experiment import Experiment
    from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo
    from uq.monte_carlo.trials import joined_processes as cluster

    start_jax()
    if processes > 1:
        cluster.join(f"127.0.0.1:{port}", processes, process)
    experiment = Experiment.load("barreto2016")
    plan = SamplingPlan(engine="samples", dtype="float32")
    for _ in range(2):  # the first compiles
        begin = time.perf_counter()
        result = montecarlo(experiment, trials=TRIALS, trajectories="T1", estimators="central", plan=plan)
    if process == 0:
        print(time.perf_counter() - begin, result["T1", "central"].total.three_sigma.tobytes().hex())
    if processes > 1:
        cluster.leave()


def campaign(cores: list[int]) -> tuple[float, str]:
    """Return the seconds of a campaign with a process on each core, and its 3σ as bytes."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    commands = [
        [sys.executable, "-m", "benchmarks.processes", "--worker", *map(str, (core, port, len(cores), process))]
        for process, core in enumerate(cores)
    ]
    started = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for command in commands]
    outputs = [process.communicate()[0] for process in started]
    seconds, bits = outputs[0].split()
    return float(seconds), bits


def main() -> None:
    """Time both and print the ratio; see that the bits are the same."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.processes", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="alternations (3)")
    parser.add_argument("--worker", type=int, nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        worker(*options.worker)
        return
    cores = sorted(os.sched_getaffinity(0))[:2]
    rounds = [(campaign(cores[:1]), campaign(cores)) for _ in range(options.rounds)]
    for name, index in (("one process, one core", 0), ("two processes, two cores", 1)):
        seconds = [pair[index][0] for pair in rounds]
        print(f"{name:<26} {statistics.median(seconds):7.2f} s (median; {min(seconds):.2f} … {max(seconds):.2f})")
    ratios = [alone[0] / both[0] for alone, both in rounds]
    print(f"{'times the speed':<26} {statistics.median(ratios):7.2f}   (median; {min(ratios):.2f} … {max(ratios):.2f})")
    print("3σ the same to the last bit:", len({bits for pair in rounds for _, bits in pair}) == 1)


if __name__ == "__main__":
    main()

"""When ``--until`` ends a recording: ``python -m benchmarks.live_until [RUNS]``.

Simulated runs of T1 are handed over in pieces, as a growing file is; each has its own errors. Printed are the promised
duration, the time at which the target was reached by that promise, and whether identification of what had been recorded
until then has the target, too. The promise is ``required_duration``'s.
"""

import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np

from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from rig.bags.growing_file import GrowingFile
from rig.mcap.message_definitions import IMU, WRENCH
from uq.cli.terminal.common import start_jax
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.plan.measurement.required_duration import growth_of, lasting, required_duration
from uq.runs.identification.systematic_errors import nodes_of
from uq.runs.live import live_estimate
from uq.runs.live.growing_run import GrowingRun
from uq.runs.live.live_estimate import estimated, sources_in
from uq.runs.live.running_sums import RunningSums
from uq.runs.recorded.time_window import TimeWindow

EXPERIMENT = Path(__file__).parent.parent / "uq" / "examples" / "t1-10s.toml"
TARGET = 2.5e-3
"""Half the interval of 95 % of every component [kg·m²]."""
NORMAL = 1.959963984540054
LONGER = 1.8
"""Duration of the simulated runs, as a multiple of the promised one."""


def promised(experiment: Experiment) -> float:
    """The duration that the law promises for the slowest component [s]."""
    growth = growth_of(experiment)
    goals = [required_duration(experiment, 3 * TARGET / NORMAL, goal=name, growth=growth) for name in COMPONENTS]
    return max(float(goal.seconds or np.inf) for goal in goals)


def reached(experiment: Experiment, path: Path) -> float:
    """When two estimates in a row have the target [s]."""
    spec, nodes = experiment.estimator(), nodes_of(sources_in(experiment))
    growing = GrowingFile(path, {WRENCH: None, IMU: None})
    run, sums, in_a_row = GrowingRun(path, experiment.recording, spec, ("/wrench", "/imu")), RunningSums(spec, nodes), 0
    run.add(growing.take())
    for block in run.blocks(growing.definitions.metadata, ended=True):
        sums.add(block)
        if not sums.products[0, 0]:
            continue
        in_a_row = in_a_row + 1 if (estimated(sums, experiment).half_width <= TARGET).all() else 0
        if in_a_row == 2:
            return block.end
    return np.inf


def main() -> None:
    """Run and print."""
    start_jax()
    live_estimate.TRIALS = 500
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 50
    short = Experiment.load(EXPERIMENT)
    seconds = promised(short)
    name, spec = short.select(None)
    longer = lasting(spec, round(LONGER * seconds))
    experiment = dataclasses.replace(short, trajectories={name: longer}, document={})
    times, halves = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        for seed in range(runs):
            simulate(experiment, seed=seed).write(path, overwrite=True)
            times.append(reached(experiment, path))
            if seed < 10:
                halves.append(_identified(experiment, path, times[-1]))
    ratio = np.array(times) / seconds
    near = [f"{np.mean(np.abs(ratio - 1) < limit):.0%} within {limit:.0%}" for limit in (0.1, 0.2, 0.3)]
    print(f"target ± {GRAM_METRE * TARGET:g} g·m², promised {seconds:.1f} s, {runs} runs")
    print(f"reached / promised: mean {ratio.mean():.3f}, standard deviation {ratio.std():.3f}; {', '.join(near)}")
    print(f"interval of identify / target: mean {np.mean(halves):.3f}, {min(halves):.3f} to {max(halves):.3f}")


def _identified(experiment: Experiment, path: Path, seconds: float) -> float:
    from uq.runs.identification.identify_files import identify_files

    result = identify_files([path], experiment, windows=[TimeWindow(0.0, seconds)])
    return float(np.diff(result.interval95, axis=1).max() / 2 / TARGET)


if __name__ == "__main__":
    main()

"""Real throws of bodies of known tensor: what the 95 % intervals of ``identify``, of least squares and of sysid hold.

``python -m benchmarks.studies.throws FOLDER [--experiment FILE]``. The folder holds a ``truth.json`` (of each body,
``inertia_total_about_cg_kgmm2`` by component) and recordings ``BODY_NUMBER.mcap``. They are not part of the project.
Plain is what a user writes: central differences, ``numpy.linalg.lstsq`` and the covariance ``s² (AᵀA)⁻¹``.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np

from benchmarks.studies.mujoco_sysid import AVAILABLE, INSTALL, thrown_by_sysid
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, features
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from identify.sums.run_lines import rows_of
from uq.experiment.experiment import Experiment
from uq.identification.identify_files import identify_files
from uq.recorded.load_run import load_run

MOMENTS = [0, 3, 5]
Way = Callable[[Sequence[Path]], np.ndarray]
"""From recordings of one body to the ends of its six intervals, (6, 2) [kg·m²]."""


def plain(runs: Sequence[Run]) -> np.ndarray:
    """Return the intervals of least squares over all samples of some runs, as its users write it."""
    phi = [features(run.omega.T, np.gradient(run.omega.T, 1 / run.rate, axis=1)) for run in runs]
    return least_squares(phi, [run.moment.T for run in runs])


def plain_lowpassed(runs: Sequence[Run], estimator: EstimatorSpec) -> np.ndarray:
    """Return the same, both sides of the regression behind the differentiator and low-pass of ``identify``."""
    rows = [rows_of(run, estimator) for run in runs]
    return least_squares([row.phi for row in rows], [row.moment for row in rows])


def least_squares(phi: Sequence[np.ndarray], moment: Sequence[np.ndarray], *, offsets: bool = False) -> np.ndarray:
    """Return the textbook's intervals, by ``s² (XᵀX)⁻¹``.

    Args:
        phi: features of each run, (9, n).
        moment: about the centre of gravity, (3, n) [N·m].
        offsets: whether three columns for an offset of the moment are added.
    """
    columns = np.einsum("kn,kij->nij", np.hstack(phi), OMEGA_R_OF_FEATURES).reshape(-1, 6)
    values = np.hstack(moment).T.ravel()
    if offsets:
        columns = np.hstack([columns, np.tile(np.eye(3), (len(values) // 3, 1))])
    estimate = np.linalg.lstsq(columns, values)[0]
    variance = ((values - columns @ estimate) ** 2).sum() / (len(values) - len(estimate))
    return interval(estimate[:6], (variance * np.linalg.inv(columns.T @ columns))[:6, :6])


def by_sysid(runs: Sequence[Run], estimator: EstimatorSpec) -> np.ndarray:
    """Return the intervals of ``mujoco.sysid``: from the same low-pass, and from the estimate of least squares."""
    nominal = plain_lowpassed(runs, estimator).mean(axis=1)
    return interval(*thrown_by_sysid([lowpassed(run, estimator) for run in runs], nominal))


def lowpassed(run: Run, estimator: EstimatorSpec) -> Run:
    """Return moment and angular velocity behind an estimator's low-pass, without its ends."""
    taps = estimator.filter_taps(run.rate)
    inner = slice(len(taps) // 2, len(run.t) - len(taps) // 2)
    moment, omega = (
        np.stack([np.convolve(axis, taps, "valid") for axis in channel.T], axis=1)
        for channel in (run.moment, run.omega)
    )
    return Run.from_arrays(run.t[inner], run.force[inner], moment, omega, name=run.name)


def interval(estimate: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the ends of normal intervals of 95 %, (6, 2)."""
    half = 1.96 * np.sqrt(np.diag(covariance))
    return np.stack([estimate - half, estimate + half], axis=1)


def ways_of(experiment: Experiment) -> dict[str, Way]:
    """Return what is compared, by name."""
    estimator = experiment.estimator()
    undeclared = replace(experiment, sources=(), mixing=())

    def loaded(files: Sequence[Path]) -> list[Run]:
        return [load_run(file, experiment.recording) for file in files]

    ways: dict[str, Way] = {
        "identify": lambda files: identify_files(files, experiment).interval95,
        "identify, no sources": lambda files: identify_files(files, undeclared).interval95,
        "plain": lambda files: plain(loaded(files)),
        "plain, low-pass": lambda files: plain_lowpassed(loaded(files), estimator),
    }
    if AVAILABLE:
        ways["mujoco.sysid"] = lambda files: by_sysid(loaded(files), estimator)
    return ways


def holds(interval: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return which intervals hold the truth, (6,)."""
    return (interval[:, 0] <= truth) & (truth <= interval[:, 1])


def lines_of(body: str, names: Sequence[str], intervals: dict[str, np.ndarray], truth: np.ndarray) -> list[str]:
    """Return a line for each recording, one for all of them, and one for the recordings pooled.

    Args:
        body: its name.
        names: of the recordings, the last that of them pooled.
        intervals: of each way, (recordings + 1, 6, 2).
        truth: the tensor, (6,).
    """
    held = {way: np.array([holds(interval, truth) for interval in ends]) for way, ends in intervals.items()}
    lines = [
        f"{name:14}" + "".join(f"{f'{in_run[number].sum()}/6':>24}" for in_run in held.values())
        for number, name in enumerate(names)
    ]
    width = {way: np.diff(ends)[:, MOMENTS, 0] / 2 / truth[MOMENTS] for way, ends in intervals.items()}
    single = "".join(
        f"{f'{100 * held[way][:-1].mean():.0f} % (±{100 * np.median(width[way][:-1]):.2g} %)':>24}" for way in intervals
    )
    together = "".join(f"{f'{held[way][-1].sum()}/6 (±{100 * width[way][-1].mean():.2g} %)':>24}" for way in intervals)
    return [*lines[:-1], f"{f'{body}, single':14}{single}", f"{f'{body}, pooled':14}{together}"]


def table(folder: Path, ways: Mapping[str, Way]) -> Iterator[str]:
    """Yield the table of a folder of throws, body after body."""
    yield f"{'holds of six':14}" + "".join(f"{name:>24}" for name in ways)
    for body, about in json.loads((folder / "truth.json").read_text()).items():
        truth = 1e-6 * np.array([about["inertia_total_about_cg_kgmm2"][name] for name in COMPONENTS])
        files = sorted(folder.glob(f"{body}_*.mcap"))
        selections = [*([file] for file in files), files]
        intervals = {name: np.array([way(selection) for selection in selections]) for name, way in ways.items()}
        yield from lines_of(body, [*(file.name for file in files), "pooled"], intervals, truth)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--experiment", default="uq/examples/throws.toml")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    if not AVAILABLE:
        print(INSTALL)
    for line in table(arguments.folder, ways_of(Experiment.load(arguments.experiment))):
        print(line, flush=True)


if __name__ == "__main__":
    main()

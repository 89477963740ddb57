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
from identify.least_squares.run_lines import MOTION, OMEGA_R_OF_ACTING, rows_of
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, features
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from tests.helpers.interval_quality import error_over_u, interval_score
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load_run

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
    return least_squares([row.signals[MOTION] for row in rows], [row.signals[-3:] for row in rows], OMEGA_R_OF_ACTING)


def least_squares(
    phi: Sequence[np.ndarray],
    moment: Sequence[np.ndarray],
    omega_r: np.ndarray = OMEGA_R_OF_FEATURES,
    *,
    offsets: bool = False,
) -> np.ndarray:
    """Return the textbook's intervals, by ``s² (XᵀX)⁻¹``.

    Args:
        phi: features of each run, (k, n).
        moment: about the centre of gravity, (3, n) [N·m].
        omega_r: Omega_R of a unit of each feature, (k, 3, 6).
        offsets: whether three columns for an offset of the moment are added.
    """
    columns = np.einsum("kn,kij->nij", np.hstack(phi), omega_r).reshape(-1, 6)
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


def bound(result: Identification) -> np.ndarray:
    """Return the conventional bound, which holds undeclared errors."""
    return np.asarray(result.conventional_bound)


def ways_of(experiment: Experiment) -> dict[str, Way]:
    """Return what is compared, by name."""
    estimator = experiment.estimator()
    undeclared = without_sources(experiment)

    def loaded(files: Sequence[Path]) -> list[Run]:
        return [load_run(file, experiment.recording) for file in files]

    ways: dict[str, Way] = {
        "identify": lambda files: identify_files(files, experiment).interval95,
        "identify, bound": lambda files: bound(identify_files(files, experiment)),
        "identify, no sources": lambda files: identify_files(files, undeclared).interval95,
        "identify, no sources, bound": lambda files: bound(identify_files(files, undeclared)),
        "plain": lambda files: plain(loaded(files)),
        "plain, low-pass": lambda files: plain_lowpassed(loaded(files), estimator),
    }
    if AVAILABLE:
        ways["mujoco.sysid"] = lambda files: by_sysid(loaded(files), estimator)
    return ways


def holds(interval: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return which intervals hold the truth, (..., 6)."""
    return (interval[..., 0] <= truth) & (truth <= interval[..., 1])


def summary(ends: np.ndarray, truth: np.ndarray) -> str:
    """Return how many intervals hold the truth, beside how wide those of the moments are.

    Width and miss are in per cent of the truth: half the width, the median and the widest; the mean interval score;
    the error over half the width over 1.96, root mean square.

    Args:
        ends: of intervals of some runs, (runs, 6, 2).
        truth: the tensor, (6,).
    """
    held, size = holds(ends, truth), truth[MOMENTS]
    low, high = np.moveaxis(ends[:, MOMENTS], -1, 0)
    half = (high - low) / 2
    score = interval_score(ends[:, MOMENTS], size)
    return (
        f"{held.sum():4} of {held.size:3} {100 * np.median(half / size):8.2g} {100 * (half / size).max():8.2g}"
        f" {100 * (score / size).mean():8.2g} {error_over_u(ends[:, MOMENTS], size):8.2g}"
    )


HEADINGS = f"{'held':>11} {'median %':>8} {'widest %':>8} {'score %':>8} {'error/u':>8}"


def table(folder: Path, ways: Mapping[str, Way]) -> Iterator[str]:
    """Yield the table of a folder of throws: each body's single runs, and its runs pooled, by each way."""
    yield f"{'':52}{HEADINGS}"
    for body, about in json.loads((folder / "truth.json").read_text()).items():
        truth = 1e-6 * np.array([about["inertia_total_about_cg_kgmm2"][name] for name in COMPONENTS])
        files = sorted(folder.glob(f"{body}_*.mcap"))
        for name, way in ways.items():
            for words, selections in (("single", [[file] for file in files]), ("pooled", [files])):
                ends = np.array([way(selection) for selection in selections])
                yield f"{f'{body}, {words}, {name}':52}{summary(ends, truth)}"


def components(folder: Path, experiment: Experiment) -> Iterator[str]:
    """Yield error and half-widths of each component of the runs pooled, and the warnings."""
    for body, about in json.loads((folder / "truth.json").read_text()).items():
        truth = 1e-6 * np.array([about["inertia_total_about_cg_kgmm2"][name] for name in COMPONENTS])
        result = identify_files(sorted(folder.glob(f"{body}_*.mcap")), experiment)
        interval95, bounds = (np.ptp(ends, axis=1) / 2 for ends in (result.interval95, result.conventional_bound))
        rows = zip(COMPONENTS, 1e6 * (result.inertia - truth), 1e6 * interval95, 1e6 * bounds, strict=True)
        yield f"{body}, pooled, kg·mm²: error, half-widths of interval and conventional bound"
        yield from (f"  {name} {error:8.2f} ± {one:.2f} ± {two:.2f}" for name, error, one, two in rows)
        yield from (f"  warning: {text}" for text in result.warnings)


def without_sources(experiment: Experiment) -> Experiment:
    """Return an experiment that declares no error."""
    return replace(experiment, sources=(), mixing=())


def asked(description: str | None) -> tuple[Path, Experiment]:
    """Return folder and experiment of the command line, float64 switched on."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--experiment", default="uq/examples/throws.toml")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    return arguments.folder, Experiment.load(arguments.experiment)


def main() -> None:
    """Print the table."""
    folder, experiment = asked(__doc__)
    if not AVAILABLE:
        print(INSTALL)
    for line in table(folder, ways_of(experiment)):
        print(line, flush=True)
    for words, declared in (("as declared", experiment), ("no sources", without_sources(experiment))):
        print(words, *components(folder, declared), sep="\n", flush=True)


if __name__ == "__main__":
    main()

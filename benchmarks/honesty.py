"""Honesty: how often intervals hold the truth, and how often an answer is wrong without a word, on the same files.

``python -m benchmarks.honesty [--runs N] [--csv FILE]``. The files are runs of a simulated laboratory that shares no
code with any of the programs (tests/helpers/laboratory.py): clean ones, and those with one of its troubles, of a size
that a laboratory may have. The experiment declares none of them. Recordings of real bodies:
``python -m benchmarks.studies.throws``.

A program joins by one function, from a recording and its experiment to what it states (:class:`Stated`), in ``PEERS``.
"""

import argparse
import csv
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from scipy.signal import savgol_filter

from benchmarks.studies.mujoco_sysid import AVAILABLE, INSTALL, body_by_sysid
from benchmarks.studies.plain_regression import ORDER, WINDOW, stated_about_cg
from benchmarks.studies.throws import holds, least_squares
from identify.exceptions import RunError
from identify.rigid_body.inertia import Body, unpack
from identify.rigid_body.regressor import features
from tests.helpers.interval_quality import Quality, quality
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, write
from tests.helpers.troubles import TROUBLES
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load_run

CLEAN = "nothing wrong"
UNDECLARED = ", conventional bound"
WRONG = 2.0
"""Half-widths of its interval by which a component is off where an answer counts as wrong."""
SYSID_RATE = 100.0
"""Of the samples that ``mujoco.sysid`` gets [Hz]: its rollout takes them one by one; the motion ends below 3 Hz."""


class Stated(NamedTuple):
    """What a program states of a recording: the ends of its 95 % intervals, and whether it warns or refuses."""

    intervals: np.ndarray | None
    """Of I11, I12, I13, I22, I23, I33 [kg·m²], (6, 2); None: it refuses."""
    warned: bool
    with_undeclared: np.ndarray | None = None
    """The same, wider by errors that nobody declared, where it states such intervals."""


Peer = Callable[[Path, Experiment], Stated]


def identified(path: Path, experiment: Experiment, *, method: str) -> Stated:
    """Return what ``inertia identify`` states."""
    try:
        result = identify_files([path], experiment, method=method)
    except RunError:
        return Stated(None, True)
    return Stated(result.interval95, bool(result.warnings), result.conventional_bound)


def plain(path: Path, experiment: Experiment) -> Stated:
    """Return what least squares state as users write them: central differences, columns for offsets, ``s² (XᵀX)⁻¹``."""
    run = load_run(path, experiment.recording)
    phi = features(run.omega.T, np.gradient(run.omega.T, 1 / run.rate, axis=1))
    moment = run.moment - np.cross(experiment.r_cg_from_q, run.force)
    return Stated(least_squares([phi], [moment.T], offsets=True), False)


def by_sysid(path: Path, experiment: Experiment) -> Stated:
    """Return what ``mujoco.sysid`` states of smoothed motion; it starts at what plain least squares find of that."""
    run = load_run(path, experiment.recording)
    step = round(run.rate / SYSID_RATE)
    length = 2 * round(WINDOW * run.rate / 2) + 1
    smooth = partial(savgol_filter, window_length=length, polyorder=ORDER, axis=0, delta=1 / run.rate)
    omega, alpha, felt = smooth(run.omega), smooth(run.omega, deriv=1), smooth(run.specific_force)
    felt = felt - np.cross(alpha, run.imu_position) - np.cross(omega, np.cross(omega, run.imu_position))
    moment = run.moment - np.cross(experiment.r_cg_from_q, run.force)
    start = least_squares([features(omega.T, alpha.T)], [moment.T], offsets=True).mean(axis=1)
    body = Body(np.asarray(experiment.mass), experiment.r_cg_from_q, possible(start))
    wrench = np.hstack([run.force, run.moment])
    ten = body_by_sysid(body, *(values[::step] for values in (run.t, omega, alpha, felt, wrench)))
    values, half = stated_about_cg(*ten)
    return Stated(np.stack([values - half, values + half], axis=1)[4:], False)


def possible(inertia: np.ndarray) -> np.ndarray:
    """Return a tensor that MuJoCo takes: its second moments at least a hundredth of the largest, (6,)."""
    tensor = np.asarray(unpack(inertia))
    moments, axes = np.linalg.eigh(np.trace(tensor) / 2 * np.eye(3) - tensor)
    second = axes * np.maximum(moments, moments.max() / 100) @ axes.T
    return (np.trace(second) * np.eye(3) - second)[np.triu_indices(3)]


PEERS: dict[str, Peer] = {
    f"identify, {method}": partial(identified, method=method) for method in ("source", "gls", "joint")
} | {"plain least squares": plain}
if AVAILABLE:
    PEERS["mujoco.sysid"] = by_sysid


class Judged(NamedTuple):
    """One answer beside the truth."""

    trouble: str
    seed: int
    peer: str
    covered: int
    """Components, of six, whose interval holds the truth; those of a refusal count as none."""
    half_widths: float
    """The largest error in half-widths of its interval; not a number where it refuses."""
    error_over_u: float
    """Root mean square of the errors over half the width over 1.96; not a number where it refuses."""
    score: float
    """Mean interval score over the largest moment, in %; not a number where it refuses."""
    warned: bool
    seconds: float
    """Processor time, without what the first run compiles."""

    @property
    def silent(self) -> bool:
        """Whether the answer is wrong and no warning says so."""
        return self.half_widths > WRONG and not self.warned


def judged(trouble: str, seed: int, folder: Path) -> Iterator[Judged]:
    """Yield each program's answer about one run of the laboratory."""
    options = {} if trouble == CLEAN else TROUBLES[trouble].options(TROUBLES[trouble].typical, seed)
    if trouble != CLEAN and TROUBLES[trouble].still is not None:
        options["still"] = TROUBLES[trouble].still
    measured = measure(seed, **options)
    path, experiment = write(folder / "run.mcap", measured), Experiment.from_dict(document(measured))
    for name, peer in PEERS.items():
        began = time.process_time()
        stated = peer(path, experiment)
        spent = time.process_time() - began
        for label, intervals in ((name, stated.intervals), (f"{name}{UNDECLARED}", stated.with_undeclared)):
            covered, off, shown = 0, np.nan, Quality(np.nan, np.nan, np.nan)
            if intervals is not None:
                covered = int(holds(intervals, measured.truth).sum())
                off = float((np.abs(measured.truth - intervals.mean(axis=1)) / np.ptp(intervals, axis=1)).max() * 2)
                shown = quality(intervals, measured.truth)
            elif label != name:
                continue
            yield Judged(trouble, seed, label, covered, off, shown.error_over_u, shown.score, stated.warned, spent)


def row(peer: str, answers: Sequence[Judged]) -> str:
    """A line of the table."""
    clean, troubled = ([a for a in answers if (a.trouble == CLEAN) == wanted] for wanted in (True, False))

    def share(values: Sequence[bool]) -> str:
        return f"{sum(values)} of {len(values)}"

    def width(some: Sequence[Judged]) -> list[str]:
        stated = [a for a in some if np.isfinite(a.half_widths)]
        ratio = np.sqrt(np.mean([a.error_over_u**2 for a in stated]))
        covered = f"{100 * np.mean([a.covered for a in stated]) / 6:.0f}"
        return [covered, f"{ratio:.2g}", f"{np.mean([a.score for a in stated]):.2g}"]

    cells = [
        *width(clean), share([a.warned for a in clean]), *width(troubled),
        share([a.half_widths > WRONG for a in troubled]), share([a.silent for a in troubled]),
        f"{np.nanmax([a.half_widths for a in troubled if not a.warned], initial=0.0):.2g}",
        f"{np.median([a.seconds for a in answers]):.1f}",
    ]  # fmt: skip
    return f"| {peer} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1, help="with each trouble")
    parser.add_argument("--clean", type=int, default=20, help="runs without")
    parser.add_argument("--csv", type=Path, help="file for every answer")
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    if not AVAILABLE:
        print(INSTALL)
    answers: list[Judged] = []
    cases = [(CLEAN, seed) for seed in range(arguments.clean)]
    cases += [(name, seed) for name in TROUBLES for seed in range(500, 500 + arguments.runs)]
    with tempfile.TemporaryDirectory() as folder, (arguments.csv or Path(os.devnull)).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(Judged._fields)
        for case in cases:
            judgements = list(judged(*case, Path(folder)))
            writer.writerows(judgements)
            file.flush()
            answers += judgements
    print(
        "| program | clean: covered, % | error/u | score, % | warned "
        "| troubles: covered, % | error/u | score, % | wrong | without a warning | off by up to | seconds |"
    )
    print("|" + "---|" * 12)
    for name in dict.fromkeys(answer.peer for answer in answers):
        print(row(name, [answer for answer in answers if answer.peer == name]))


if __name__ == "__main__":
    main()

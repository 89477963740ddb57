"""Real throws: scatter of single runs over the standard uncertainty from their residuals (type A), and why they differ.

``python -m benchmarks.studies.throw_scatter FOLDER [--experiment FILE]``; the folder is that of
:mod:`benchmarks.studies.throws`, with two bodies or more. Residuals hold what a run lacks, random or not: what all runs
lack alike widens each run's interval and moves all of them together, so that it is missing in their scatter. Here that
is shown of the IMU's axes: their six cross-axis terms, which may stand for a turn and for axes that are not at right
angles, are fitted to all runs of a body, and those of the other bodies correct it.
"""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from benchmarks.studies.throws import MOMENTS, asked
from identify.least_squares.run_information import Information, information
from identify.least_squares.run_lines import run_lines
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from uq.experiment.experiment import Experiment
from uq.runs.recorded.load_run import load_run

TERMS = [(row, column) for row in range(3) for column in range(3) if row != column]
"""Cross-axis terms, by row and column of the matrix that is added to 1."""
I12 = COMPONENTS.index("I12")
STEP = 1e-3
HALF = 0.5
"""Gain of the low-pass down to which lines of the residuals are looked at."""
Terms = Float[np.ndarray, "3 3"]


class Equations(NamedTuple):
    """Residuals of runs, a tensor of each run eliminated, and what the cross-axis terms add to them."""

    columns: Float[np.ndarray, "n 6"]
    residuals: Float[np.ndarray, " n"]

    def terms(self) -> tuple[Terms, float]:
        """Return the terms of least squares, and the part of the residuals' power that they explain."""
        solution = np.linalg.lstsq(self.columns, self.residuals)[0]
        terms = np.zeros((3, 3))
        terms[tuple(np.transpose(TERMS))] = solution
        unexplained = self.residuals - self.columns @ solution
        return terms, 1 - float(unexplained @ unexplained) / float(self.residuals @ self.residuals)


def with_terms(run: Run, terms: Terms) -> Run:
    """Return a run with cross-axis terms added to its gyro's."""
    return Run.from_arrays(run.t, run.force, run.moment, run.omega @ (np.eye(3) + terms).T, name=run.name)


def equations(run: Run, truth: Float[np.ndarray, "6"], estimator: EstimatorSpec) -> Equations:
    """Return the equations of a run of a body of known tensor, of the lines that the low-pass passes."""
    lines = run_lines(run, estimator)
    inside = slice(0, int((estimator.passed(run.rate, lines.lines.frequency) >= HALF).sum()))
    rows, changes = lines[inside], list[np.ndarray]()
    for term in TERMS:
        terms = np.zeros((3, 3))
        terms[term] = STEP
        changed = run_lines(with_terms(run, terms), estimator)
        changes.append(((changed[inside] - rows) @ truth).ravel() / STEP)
    sides = np.column_stack([*changes, lines.about_cg(np.zeros(3), inside).ravel()])
    spanned = np.linalg.qr(rows.reshape(-1, 6))[0]
    beside = sides - spanned @ (spanned.T @ sides)
    return Equations(beside[:, :-1], beside[:, -1])


def type_a(shown: Sequence[Information]) -> tuple[np.ndarray, np.ndarray]:
    """Return the scatter of single runs, and the root mean square of their standard uncertainty, (6,) [kg·m²]."""
    scatter = np.std([run.inertia for run in shown], axis=0, ddof=1)
    return scatter, np.sqrt(np.mean([np.diag(run.covariance) for run in shown], axis=0))


def row(label: str, runs: list[Run], truth: np.ndarray, estimator: EstimatorSpec) -> str:
    """Return a line on some runs: their moments, and the mean error of I12, which the right terms would take away."""
    shown = [information(run, estimator, np.zeros(3), offsets="none") for run in runs]
    scatter, stated = (values[MOMENTS] for values in type_a(shown))
    cells = [100 * scatter / truth[MOMENTS], 100 * stated / truth[MOMENTS], scatter / stated]
    error = 1e6 * float(np.mean([run.inertia for run in shown], axis=0)[I12] - truth[I12])
    texts = [", ".join(f"{value:.2f}" for value in values) for values in cells]
    return f"| {label} | {' | '.join(texts)} | {error:.1f} |"


def table(folder: Path, experiment: Experiment) -> Iterator[str]:
    """Yield the lines of a folder of throws."""
    estimator, bodies, terms = experiment.estimator(), {}, {}
    for body, about in json.loads((folder / "truth.json").read_text()).items():
        truth = 1e-6 * np.array([about["inertia_total_about_cg_kgmm2"][name] for name in COMPONENTS])
        runs = [load_run(file, experiment.recording) for file in sorted(folder.glob(f"{body}_*.mcap"))]
        parts = [equations(run, truth, estimator) for run in runs]
        together = Equations(*(np.concatenate(sides) for sides in zip(*parts, strict=True)))
        bodies[body], (terms[body], explained) = (runs, truth), together.terms()
        values = ", ".join(f"{terms[body][term]:.3f}" for term in TERMS)
        yield f"{body}: cross-axis terms {values} explain {100 * explained:.0f} % of the residuals' power"
    yield "| body | scatter of I11, I22, I33, % | u of one run, % | scatter over u | mean error of I12, kg·mm² |"
    yield "|---|---|---|---|---|"
    for body, (runs, truth) in bodies.items():
        others = np.mean([value for name, value in terms.items() if name != body], axis=0)
        yield row(body, runs, truth, estimator)
        yield row(f"{body}, corrected", [with_terms(run, others) for run in runs], truth, estimator)


def main() -> None:
    """Print the table."""
    for line in table(*asked(__doc__)):
        print(line, flush=True)


if __name__ == "__main__":
    main()

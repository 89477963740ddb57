"""Figures of an identification, with their captions: budget, residuals, coverage, runs, parts of runs."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from identify.reporting import Drawing
from identify.results import measured_directions
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.inertia import GRAM_METRE
from identify.rounding import fixed, significant


def budget_drawings(parts: Mapping[str, np.ndarray], standard_uncertainty: np.ndarray) -> Iterator[Drawing]:
    """Yield the figure of the contributions to the standard uncertainty, where they are known."""

    def draw():
        from identify.results.contribution_figure import shares

        return shares(parts, standard_uncertainty)

    if parts:
        yield Drawing("budget", BUDGET, draw)


def residual_drawings(runs: Sequence[RunEstimate]) -> Iterator[Drawing]:
    """Yield the figure of the residuals, where runs kept them."""

    def draw():
        from identify.results.run_figures import residuals

        return residuals(largest)

    largest = largest_residuals(runs)
    if largest:
        few = f" The {MOST} runs with the largest residuals of {len(runs)}." if len(largest) < len(runs) else ""
        yield Drawing("residuals", f"{RESIDUALS}{few}", draw)


def coverage_drawings(runs: Sequence[RunEstimate], covariance: np.ndarray) -> Iterator[Drawing]:
    """Yield the figure of the axes that the motion visited, where runs kept it."""
    paths = measured_directions.motion(runs)
    if paths is None:
        return
    omega, alpha = paths

    def draw():
        from identify.results.sphere_figures import coverage

        return coverage(omega, alpha, covariance)

    yield Drawing("coverage", _coverage_caption(omega, alpha, covariance), draw)


def run_drawings(
    runs: Sequence[RunEstimate], inertia: np.ndarray, interval95: np.ndarray, taken_off: np.ndarray
) -> Iterator[Drawing]:
    """Yield the figures of each run's estimate, of two or more, and, where parts of runs were cut out, of those."""

    def draw_estimates():
        from identify.results.run_figures import estimates

        return estimates(runs, inertia, interval95, taken_off)

    def draw_parts():
        from identify.results.run_figures import parts

        return parts(runs)

    if sum(run.alone for run in runs) > 1:
        yield Drawing("runs", "Each component: each run alone, and all together.", draw_estimates)
    if any(run.overview is not None for run in runs):
        used = " ".join(f"{run.used}." for run in runs if run.used)
        yield Drawing("parts", f"The part of each run that counts. {used}", draw_parts)


def largest_residuals(runs: Sequence[RunEstimate]) -> list[RunEstimate]:
    """Return the runs whose residuals are drawn: those with the largest, in the order given."""
    traced = [run for run in runs if run.trace is not None]
    largest = sorted(traced, key=lambda run: -float(np.sum(run.residual**2)))[:MOST]
    return [run for run in traced if any(run is other for other in largest)]


def _coverage_caption(omega: np.ndarray, alpha: np.ndarray, covariance: np.ndarray) -> str:
    omega_share, alpha_share = (f"{100 * measured_directions.visited(path):.0f} %" for path in (omega, alpha))
    rms, uncertainty = measured_directions.rms_about(alpha), measured_directions.uncertainty_about(covariance)
    (weak, low), (strong, high) = rms.least, rms.largest
    doubtful, u = uncertainty.largest
    certain = (
        f"The moment of inertia is least certain about {_axis(doubtful)}: u = {significant(GRAM_METRE * u, 2)} g·m²."
        if np.isfinite(u)
        else "The moment of inertia is not determined about every axis."
    )
    return (
        "Excitation over the sphere of directions, in the body frame: discs of equal area about b3, the half of −b3 "
        f"seen through from +b3. Within 15° of {omega_share} of all axes the angular velocity came with half its "
        f"largest magnitude or more, the angular acceleration within 15° of {alpha_share}. Root mean square of the "
        f"angular acceleration: {significant(low)} rad/s² about {_axis(weak)}, the weakest axis, {significant(high)} "
        f"about {_axis(strong)}. {certain}"
    )


def _axis(direction: np.ndarray) -> str:
    return f"({', '.join(fixed(x, 2) for x in direction)})"


MOST = 4
"""Runs whose residuals are drawn."""
BUDGET = "Who causes how much of each component's variance: what the runs show (type A) and what is declared (type B)."
RESIDUALS = (
    "What the fit leaves of the moment about the centre of gravity: over time, and as amplitude density beside that of "
    "the moment itself."
)

"""The view of a centre from static poses: mass, centre of gravity, offsets, correlations and the poses' residuals."""

import numpy as np

from identify.display.reporting import Drawing, Section, section_of, uncaptioned
from identify.display.rounding import fixed, rounded, significant, with_uncertainty
from identify.display.text_tables import Table, sentence
from identify.estimation.static_poses.centre_result import PARAMETERS, UNITS, Centre
from uq.report.drawing import drawing
from uq.report.tables.identification import BOUND

WIDER = 1.01
"""Conventional bound over the coverage interval from which it is shown."""


def title(centre: Centre) -> str:
    """Return mass, poses and residuals in one line."""
    force, moment = centre.residual
    u = float(centre.standard_uncertainty[0])
    mass = with_uncertainty(centre.mass, u)
    low, high = centre.interval95[0]
    ends = centre.conventional_bound
    bound = _bound(*ends[0]) if ends is not None and centre.undeclared and centre.undeclared.rows else ""
    return (
        f"mass {mass} kg (95 %: {rounded(low, u)} … {rounded(high, u)}{bound}) from {centre.poses} poses; "
        f"residuals {significant(force)} N and {significant(moment)} N·m (rms)"
    )


def _bound(low: float, high: float) -> str:
    """The conventional bound of the mass."""
    half = (high - low) / 2
    return f"; {BOUND}: {rounded(low, half)} … {rounded(high, half)}"


def tables(centre: Centre) -> list[Table]:
    """Return centre of gravity and offsets: x, y, z with standard uncertainties, and the expanded ones of 95 %."""
    u, expanded = centre.standard_uncertainty, centre.coverage_factor * centre.standard_uncertainty
    quantities = (
        ("centre of gravity, mm", 1e3, centre.r_cg, slice(1, 4)),
        ("force offset, N", 1.0, centre.force_offset, slice(4, 7)),
        ("moment offset, N·m", 1.0, centre.moment_offset, slice(7, 10)),
    )
    rows = []
    for name, unit, values, place in quantities:
        rows.append([name, *map(with_uncertainty, unit * values, unit * u[place])])
        rows.append(["· 95 %", *(f"± {significant(value, 2)}" for value in unit * expanded[place])])
        half = expanded if centre.undeclared is None else centre.undeclared.half_width(expanded)
        if (half[place] > WIDER * expanded[place]).any():
            rows.append([f"· {BOUND}", *(f"± {significant(value, 2)}" for value in unit * half[place])])
    if centre.zero is not None:
        rows += [
            ["zero of the cell, N", *(fixed(value, 3) for value in centre.zero[:3])],
            ["zero of the cell, N·m", *(fixed(value, 4) for value in centre.zero[3:])],
        ]
    return [Table("Centre of gravity and offsets", ["", "x", "y", "z"], rows)]


overview = uncaptioned


def notes(centre: Centre) -> list[str]:
    """Return warnings and assumptions, a line each."""
    return [
        *findings(centre),
        *(f"warning: {text}" for text in centre.warnings),
        *_gap(centre),
        *(f"assumed: {text}" for text in centre.assumptions),
    ]


def findings(centre: Centre) -> list[str]:
    """Return how well the poses determine the centre, and the check against a scale."""
    axes, along = centre.directions
    worst = ", ".join(fixed(x, 2) for x in axes[2])
    best, most = (significant(1e3 * along[k], 2) for k in (0, 2))
    tilt = "" if centre.largest_tilt is None else f"tilted by up to {np.degrees(centre.largest_tilt):.3g}°: "
    along_axes = f"known worst along ({worst}), to {most} mm, and best to {best} mm"
    finding = f"{tilt}the centre of gravity is {along_axes}"
    return [finding, *([] if centre.gain is None else [centre.gain.verdict])]


def _gap(centre: Centre) -> list[str]:
    """A line on the undeclared error that widens the interval of mass or centre of gravity most, or none."""
    u = np.where(np.arange(len(PARAMETERS)) < 4, centre.standard_uncertainty, 0.0)
    gap = centre.undeclared and centre.undeclared.largest(u)
    return [gap.text] if gap else []


def drawings(centre: Centre) -> list[Drawing]:
    """Return the figure of the residuals."""
    return [drawing("residuals", "What each pose leaves unexplained.", "recordings.pose_residuals", centre.residuals)]


def section(centre: Centre) -> Section:
    """Return its part of a report."""
    method = (
        f"From static poses, by least squares: {title(centre)}; local gravity {centre.gravity:.6g} m/s². "
        "Force, moment and centre of gravity are in the body frame, about Q; ± is a standard uncertainty."
    )
    return section_of(
        centre, title="Mass and centre of gravity of a body", computed=[method, *map(sentence, findings(centre))],
        details=[_correlations(centre)], assumptions=list(map(sentence, centre.assumptions)),
    )  # fmt: skip


def _correlations(centre: Centre) -> Table:
    """The ten parameters' standard uncertainties, in SI, and their correlations."""
    u = centre.standard_uncertainty
    correlation = centre.covariance / np.maximum(np.outer(u, u), 1e-300)
    rows = [
        [f"{name}, {unit}", significant(sigma, 2), *(fixed(x, 2) for x in row)]
        for name, unit, sigma, row in zip(PARAMETERS, UNITS, u, correlation, strict=True)
    ]
    head = ["", "u", *map(str, range(1, 11))]
    return Table("Standard uncertainties in SI, and correlations", head, rows)

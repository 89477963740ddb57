"""The view of a calibration: the rig's errors before and after the runs of known bodies."""

import numpy as np

from identify.display.reporting import Section, section_of
from identify.display.rounding import beside_uncertainty, significant
from identify.display.text_tables import Table
from uq.bodies.calibration.calibration_result import CalibratedError, Calibration, units_of
from uq.files.units import printed
from uq.sources.draw_figures import part_of

NOTE = (
    "before: standard uncertainty as declared or typical; after: mean and standard uncertainty by the runs. Errors "
    "marked with – are not determined, and not written."
)
WIRES = ("F1", "F2", "F3", "M1", "M2", "M3")


def title(result: Calibration) -> str:
    """Return bodies and runs in one line."""
    return result.title()


def tables(result: Calibration) -> list[Table]:
    """Return each number of each error; of cross-talk those that the runs determine."""
    written = set(result.written())
    rows = [
        row for place, error in enumerate(result.errors) for row in _rows(error, is_written=place in written)
    ]  # fmt: skip
    head = ["error", "", "before", "after", "u after", ""]
    return [Table("Errors of load cell and IMU", head, rows, NOTE)]


def _rows(error: CalibratedError, *, is_written: bool) -> list[list[str]]:
    source, units = error.source, units_of(error.source).ravel()
    matrix, rows = np.shape(source.sigma) == (6, 6), []
    for k, (prior, mean, u) in enumerate(zip(error.prior, error.mean, error.standard_uncertainty, strict=True)):
        if not prior > 0 or (matrix and not u < 0.9 * prior):
            continue
        part, unit = part_of(str(units[k])), printed(str(units[k]))
        axis = f"{WIRES[k // 6]} from {WIRES[k % 6]}" if matrix else str(k + 1) if len(error.mean) > 1 else ""
        name = f"{source.kind.replace('_', ' ')} of {source.target}, {unit}"
        after = [beside_uncertainty(mean / part, u / part, u / part), significant(u / part, 2)]
        rows.append([name, axis, significant(prior / part, 2), *after, "" if is_written else "–"])
    return rows


def notes(result: Calibration) -> list[str]:
    """Return the departure from the priors, and the warnings, a line each."""
    departure = (
        f"departure from what was expected: chi-squared {significant(result.departure)}, {result.directions} degrees "
        f"of freedom, P {significant(result.chance, 2)}"
    )
    scatter = f"the runs scatter {significant(result.scatter, 2)} times as much as their noise; u has it"
    return [departure, *[scatter] * (result.scatter > 1), *(f"warning: {text}" for text in result.warnings)]


def section(result: Calibration) -> Section:
    """Return the calibration's part of a report."""
    return section_of(result, computed=notes(result)[:1], assumptions=result.assumptions)

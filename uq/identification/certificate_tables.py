"""The tables of a certificate."""

from collections.abc import Iterator

import numpy as np

from identify.figure_style import display_name
from identify.results.alignment import Aligned
from identify.results.contributions import evaluated
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.principal_axes import LARGEST_ANGLE, principal_axes
from identify.text_tables import Table, decimals, fixed, rounded
from uq.coverage.expanded_uncertainty import HEAD, Expanded, of_normal
from uq.experiment.conformity import decide
from uq.experiment.report_table import Report
from uq.identification import acceptance_checks as checks
from uq.report.certificate_front import INSTRUMENT_HEAD, MISSING, instrument_rows

DEGREE = float(np.degrees(1.0))
AXES = ("b1", "b2", "b3")


def tensor(result: Identification, of: Expanded) -> Table:
    """Return the six components; the bias has the decimals of U."""
    rows = []
    for row, bias, half in zip(of.rows(GRAM_METRE), result.bias, of.expanded, strict=True):
        rows.append([*row[:6], fixed(GRAM_METRE * bias, decimals(GRAM_METRE * half)), row[6]])
    count = f"{len(result.runs)} run{'s' if len(result.runs) > 1 else ''}"
    title = f"Inertia tensor about the centre of gravity, in the body frame, g·m²; {count}"
    return Table(title, ["", *HEAD[:5], "bias", HEAD[5]], rows, TENSOR_NOTE)


def mass_and_centre(result: Identification, report: Report) -> Table:
    """Return mass and centre of gravity, as stated or measured."""
    asked = {"factor": report.coverage_factor, "probability": report.coverage_probability}
    names = tuple(f"centre of gravity from Q, {axis}, mm" for axis in AXES)
    of_cg = of_normal(names, 1e3 * result.r_cg, 1e3 * result.sigma_r_cg, **asked)
    return Table("Mass and centre of gravity", ["", *HEAD], [*_mass(result, asked), *of_cg.rows()])


def _mass(result: Identification, asked: dict[str, float | None]) -> list[list[str]]:
    if result.mass is None:
        return [[f"mass: {MISSING}", *[""] * 6]]
    if not result.mass_uncertainty:
        return [["mass, kg", f"{result.mass:.6g}", *["–"] * 5]]
    return of_normal(("mass, kg",), np.array([result.mass]), np.array([result.mass_uncertainty]), **asked).rows()


def principal(result: Identification, report: Report) -> list[Table]:
    """Return the principal moments with their axes, or how well an axis is known where it is not."""
    if not np.isfinite(result.covariance).all():
        return []
    found = principal_axes(result.inertia, result.covariance)
    asked = {"factor": report.coverage_factor, "probability": report.coverage_probability}
    of = of_normal(tuple("123"), found.moments, found.standard_uncertainty, **asked)
    rows = []
    for row, axis, known, angle in zip(of.rows(GRAM_METRE), found.axes, found.determined, found.angles, strict=True):
        components = [fixed(x, 3) if known else "–" for x in axis]
        rows.append([*row[:3], *components, _degrees(angle) if angle <= LARGEST_ANGLE else "–"])
    note = PRINCIPAL_NOTE + (f" {found.note[0].upper()}{found.note[1:]}." if found.note else "")
    return [Table("Principal moments, g·m², and their axes", ["", "value", "U", *AXES, "turn, deg"], rows, note)]


def _degrees(angle: float) -> str:
    degrees = float(np.degrees(angle))
    return fixed(degrees, decimals(degrees))


def conformity(report: Report, of: Expanded) -> list[Table]:
    """Return what the decision rule says, where a statement of conformity is asked for."""
    if report.conformity is None:
        return []
    rows = []
    for one in decide(report.conformity, of.value, of.standard, of.expanded):
        low, high = (f"{GRAM_METRE * end:.6g}".replace("-", "−") for end in one.limits)
        rows.append([one.component, f"{low} … {high}", one.outcome, rounded(100 * one.probability, 0.0)])
    head = ["", "limits, g·m²", "outcome", "probability within, %"]
    return [Table(f"Conformity with {report.conformity.specification}", head, rows, CONFORMITY_NOTE)]


def instruments(report: Report) -> Table:
    """Return the instruments with their calibration."""
    rows = instrument_rows(report.instruments) or [[MISSING, *[""] * 5]]
    return Table("Instruments and their calibration", list(INSTRUMENT_HEAD), rows, wrap=True)


def budget(result: Identification) -> list[Table]:
    """Return contributions to the standard uncertainty, and the combined one."""
    parts = result.contributions
    if not parts:
        return []
    rows = [[display_name(name), evaluated(name), *_two_digits(values)] for name, values in parts.items()]
    rows.append(["combined", "", *_two_digits(result.standard_uncertainty)])
    head = ["part", "type", *COMPONENTS]
    return [Table("Budget: contributions to the standard uncertainty, g·m²", head, rows, BUDGET_NOTE)]


def scatter(result: Identification) -> list[Table]:
    """Return what repeated runs show beside what their residuals foresee."""
    found = result.pooling
    if found is None or found.runs < 2:
        return []
    rows = [["foreseen by the residuals, one run", *_two_digits(found.predicted)]]
    if found.between_runs is not None:
        rows.append(["between runs", *_two_digits(found.between_runs)])
    if found.between_mountings is not None:
        rows.append([f"between {found.mountings} mountings", *_two_digits(found.between_mountings)])
    return [Table("Repeatability: standard deviations, g·m²", ["", *COMPONENTS], rows)]


def alignment(result: Identification) -> list[Table]:
    """Return delay and rotation between load cell and IMU, where they were estimated."""
    named = [("delay of the IMU, ms", result.delay, 1e3), ("rotation vector of the IMU, deg", result.rotation, DEGREE)]
    rows = [
        [f"{name}, {axis}" if len(of.value) > 1 else name, *of_row, f"{100 * share:.2g}"]
        for name, of, unit in named if of is not None and of.estimated
        for axis, of_row, share in zip(AXES, _aligned(of, unit), of.prior_share, strict=False)
    ]  # fmt: skip
    head = ["", "value", "u", "95 % interval", "prior's share, %"]
    return [Table("Alignment of load cell and IMU, estimated with the tensor", head, rows, PRIOR_NOTE)] if rows else []


def bodies(result: Identification) -> list[Table]:
    """Return the plain estimate, where the result is what bodies allow beside weak data."""
    found = result.admissible
    if found is None:
        return []
    rows = []
    for name, value, (low, high), known in zip(
        COMPONENTS, GRAM_METRE * found.plain, GRAM_METRE * found.plain_interval95, found.determined, strict=True
    ):
        half = (high - low) / 2
        interval = f"{rounded(low, half)} … {rounded(high, half)}" if known else "–"
        rows.append([name, rounded(value, half), interval, "yes" if known else "no"])
    head = ["", "value", "95 % interval", "determined by the motion"]
    note = f"The result is what bodies allow: {found.reason}."
    return [Table("Plain estimate, before bodies alone were allowed, g·m²", head, rows, note)]


def _aligned(of: Aligned, unit: float) -> Iterator[list[str]]:
    """Value, standard uncertainty and interval of each number."""
    for value, u, (low, high) in zip(of.value, of.standard_uncertainty, of.interval95, strict=True):
        places = decimals(unit * u)
        low, high = (fixed(unit * end, places) for end in (low, high))
        yield [fixed(unit * value, places), fixed(unit * u, places), f"{low} … {high}"]


def tare(result: Identification) -> list[Table]:
    """Return what was taken off, and what it was taken off from."""
    if result.tare is None:
        return []
    both = {"with the fixture": result.tare.whole, "the fixture": result.tare.fixture, "the body": result.parameters}
    rows = [
        [name, *_with_u(of.values[:1], of.standard_uncertainty[:1], 1.0),
         *_with_u(of.values[1:4], of.standard_uncertainty[1:4], 1e3),
         *_with_u(of.values[4:], of.standard_uncertainty[4:], GRAM_METRE)]
        for name, of in both.items()
    ]  # fmt: skip
    head = ["", "mass, kg", *(f"{axis}, mm" for axis in AXES), *COMPONENTS]
    return [Table("Tare: mass, centre of gravity from Q, tensor in g·m²", head, rows, TARE_NOTE)]


def _with_u(values: np.ndarray, u: np.ndarray, unit: float) -> list[str]:
    """Figures to two digits of their standard uncertainty, which is exact where it is nought."""
    return [rounded(unit * x, unit * s) for x, s in zip(values, u, strict=True)]


def elsewhere(result: Identification) -> Iterator[Table]:
    """Return the tensor about other points and in other frames, as far as it is known."""
    if result.mass is None:
        return
    of_q = result.parameters.about()
    named = [("about the load cell's centre Q, in the body frame", of_q.inertia, of_q.standard_uncertainty)]
    if result.datum is not None:
        moved = result.parameters.in_datum(result.datum)
        where = "about the centre of gravity, in the frame of the declared datum"
        named.append((where, moved.inertia, moved.standard_uncertainty[4:]))
    for where, inertia, u in named:
        rows = [["value", *_with_u(inertia, u, GRAM_METRE)], ["u", *_two_digits(u)]]
        yield Table(f"Tensor {where}, g·m²", ["", *COMPONENTS], rows)


def checked(result: Identification) -> Table:
    """Return what was checked."""
    return Table("Checks", list(checks.HEAD), checks.rows(result), wrap=True)


def _two_digits(values: np.ndarray) -> list[str]:
    return [fixed(GRAM_METRE * x, min(decimals(GRAM_METRE * x), 4)) if x else "0" for x in values]


TENSOR_NOTE = (
    "U: expanded uncertainty, half the coverage interval; k = U/u: coverage factor; p: coverage probability; u: "
    "standard uncertainty. Rounded to two digits of the uncertainty (GUM 7.2.6). Products are the tensor's entries."
)
PRINCIPAL_NOTE = "turn: standard uncertainty of the other two axes' turn about this one."
CONFORMITY_NOTE = "probability within: that the value lies within the limits, from a normal distribution of its u."
PRIOR_NOTE = "prior's share: the part of the variance that is what was declared beforehand; 100: the data say nothing."
TARE_NOTE = "Each tensor about its own centre of gravity; figures to two digits of their standard uncertainty."
BUDGET_NOTE = (
    "A: from the data; B: declared. Correlated sources make the combined one differ from the root sum of squares."
)

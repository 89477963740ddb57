"""The tables of a certificate."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.display.rounding import beside_uncertainty, decimals, exact, fixed, interval, rounded
from identify.display.text_tables import Table, counted, sentence
from identify.results.alignment import Aligned
from identify.results.identification_result import MISFIT, Identification
from identify.results.ledger import CONVENTIONAL
from identify.results.mass_and_centre import NAMES, UNITS
from identify.results.weak_components import UNDETERMINED
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.principal_axes import LARGEST_ANGLE, principal_axes
from uq.experiment.conformity import Decision
from uq.experiment.report_table import Report
from uq.monte_carlo.coverage.expanded_uncertainty import HEAD, Expanded, of_parameters
from uq.report.certificate import checks
from uq.report.certificate.front import MISSING
from uq.report.figures.style import display_name
from uq.report.tables.identification import BOUND, bound_texts, has_bound

DEGREE = float(np.degrees(1.0))
AXES = ("b1", "b2", "b3")


def tensor(result: Identification, expanded: Expanded) -> Table:
    """Return the six components with coverage interval and conventional bound; the bias has the decimals of U.

    Args:
        result: an identification.
        expanded: its components with their expanded uncertainty.
    """
    rows = []
    columns = zip(expanded.rows(GRAM_METRE), result.bias, expanded.expanded, result.determined, strict=True)
    for row, bias, half, determined in columns:
        if determined:
            rows.append([*row, fixed(GRAM_METRE * bias, decimals(GRAM_METRE * half))])
        else:
            rows.append([row[0], "–", *["–"] * 5, UNDETERMINED, "–"])
    count = counted(len(result.runs), "run")
    title = f"Inertia tensor about the centre of gravity, in the body frame, g·m²; {count}"
    head, *rows = _intervals_first([["", *HEAD, "bias"], *rows], _bounds(result, expanded.interval, slice(4, 10)))
    return Table(title, head, rows, TENSOR_NOTE + BOUND_NOTE * has_bound(result))


def origins(result: Identification) -> list[Table]:
    """Return u by its origin: measured, declared, what the runs contradict, and typical, which u leaves out."""
    if result.undeclared is None:
        return []
    ledger = result.ledger
    origin = {tier: ledger.of_tiers(tier).standard_uncertainty[4:] for tier in ("measured", "declared", "contradicted")}
    misfit = origin["contradicted"]
    columns = {"measured": origin["measured"], "declared": origin["declared"]}
    columns |= {MISFIT: misfit} if misfit.any() else {}
    columns["typical"] = result.undeclared.standard_uncertainty[4:]
    rows = [list(row) for row in zip(COMPONENTS, *map(_two_digits, columns.values()), strict=True)]
    head = ["", *columns]
    return [Table("Standard uncertainty by origin, g·m²", head, rows, ORIGIN_NOTE)]


def _intervals_first(rows: Sequence[Sequence[str]], bounds: Sequence[str]) -> list[list[str]]:
    """Rows of :meth:`Expanded.rows` with interval and bound, if any, behind the value, where a phone shows them."""
    order = [0, 1, 7, 2, 3, 4, 5, 6, *range(8, len(rows[0]))]
    ordered = [[row[k] for k in order] for row in rows]
    return [[*row[:3], bound, *row[3:]] for row, bound in zip(ordered, bounds, strict=True)] if bounds else ordered


def _bounds(result: Identification, intervals: Float[np.ndarray, "m 2"], where: slice) -> list[str]:
    """Heading and texts of the conventional bounds of some of the ten parameters; empty without any."""
    if not has_bound(result):
        return []
    ten = result.intervals95.copy()
    ten[where] = intervals
    return [BOUND, *bound_texts(result, ten)[where]]


def mass_and_centre(result: Identification, report: Report) -> Table:
    """Return mass and centre of gravity with their intervals, and where they come from."""
    ten, unit = result.parameters, np.array(UNITS)
    four = of_parameters(result, slice(0, 4), **report.coverage)
    u, value = four.standard, four.value * unit
    rows = replace(four, value=value, standard=u * unit, interval=four.interval * unit[:, None]).rows()
    if not np.isfinite(ten.mass):
        rows[0] = [f"mass: {MISSING}", *[""] * 7]
    for k in np.flatnonzero(~(u > 0) & np.isfinite(value)):
        rows[k] = [NAMES[k], *exact([value[k]]), *["–"] * 6]
    head, *rows = _intervals_first([["", *HEAD], *rows], _bounds(result, four.interval, slice(0, 4)))
    return Table(f"Mass and centre of gravity: {result.centre_from}", head, rows)


def principal(result: Identification, expanded: Expanded) -> list[Table]:
    """Return the principal moments with U and half-width of the bound, and their axes; – for none determined.

    Args:
        result: an identification.
        expanded: its components with their expanded uncertainty, which turns into the principal axes as u does.
    """
    if not np.isfinite(result.covariance).all():
        return []
    axes = principal_axes(result.inertia, result.covariance)
    # covariances of expanded uncertainties: one U is k times u, and squares of the bound's parts add
    factors = expanded.factor[:, None] * expanded.factor
    typical = np.zeros((6, 6)) if result.undeclared is None else result.undeclared.covariance[4:, 4:]
    halves = [
        principal_axes(result.inertia, covariance).standard_uncertainty
        for covariance in (factors * result.covariance, factors * result.covariance + CONVENTIONAL**2 * typical)
    ][: 1 + has_bound(result)]
    rows = []
    for k, (moment, axis, determined, angle) in enumerate(
        zip(axes.moments, axes.axes, axes.determined, axes.angles, strict=True)
    ):
        figures = [GRAM_METRE * half[k] for half in halves]
        value = beside_uncertainty(GRAM_METRE * moment, GRAM_METRE * axes.standard_uncertainty[k], figures[0])
        components = [fixed(x, 3) if determined else "–" for x in axis]
        turn = _degrees(angle) if angle <= LARGEST_ANGLE else "–"
        rows.append([str(k + 1), value, *(rounded(half, half) for half in figures), *components, turn])
    note = PRINCIPAL_NOTE + (f" {sentence(axes.note)}" if axes.note else "")
    head = ["", "value", "U", *["half-width of the bound"] * has_bound(result), *AXES, "turn, deg"]
    return [Table("Principal moments, g·m², and their axes", head, rows, note)]


def _degrees(angle: float) -> str:
    degrees = float(np.degrees(angle))
    return fixed(degrees, decimals(degrees))


def conformity(report: Report, decisions: Sequence[Decision]) -> list[Table]:
    """Return what the decision rule says, where a statement of conformity is asked for."""
    if report.conformity is None:
        return []
    rows = []
    for decision in decisions:
        limits = " … ".join(exact(GRAM_METRE * end for end in decision.limits))
        within = fixed(100 * decision.probability, 2) if np.isfinite(decision.probability) else "–"
        rows.append([decision.component, limits, decision.outcome, within])
    head = ["", "limits, g·m²", "outcome", "probability within, %"]
    return [Table(f"Conformity with {report.conformity.specification}", head, rows, CONFORMITY_NOTE)]


def budget(result: Identification) -> list[Table]:
    """Return contributions to the standard uncertainty, and the combined one."""
    parts = result.contributions
    if not parts:
        return []
    types = result.ledger.types
    rows = [[display_name(name), types[name], *_two_digits(values)] for name, values in parts.items()]
    rows.append(["combined", "", *_two_digits(result.standard_uncertainty)])
    head = ["part", "type", *COMPONENTS]
    return [Table("Budget: contributions to the standard uncertainty, g·m²", head, rows, BUDGET_NOTE)]


def scatter(result: Identification) -> list[Table]:
    """Return the scatter of repeated runs beside the scatter that their residuals predict."""
    pooling = result.pooling
    if pooling is None or pooling.runs < 2:
        return []
    rows = [["predicted by the residuals, one run", *_two_digits(pooling.predicted)]]
    if pooling.between_runs is not None:
        rows.append(["between runs", *_two_digits(pooling.between_runs)])
    if pooling.between_mountings is not None:
        rows.append([f"between {pooling.mountings} mountings", *_two_digits(pooling.between_mountings)])
    return [Table("Repeatability: standard deviations, g·m²", ["", *COMPONENTS], rows)]


def discordance(result: Identification) -> list[Table]:
    """Return the runs that leave the others, and the pool with and without them, where there are any."""
    leaving = result.discordance
    if leaving is None:
        return []
    rows = []
    for d in leaving.departures:
        u = GRAM_METRE * d.standard_uncertainty
        rows.append([d.name, d.component, rounded(GRAM_METRE * d.difference, u), rounded(u, u)])
    compared = []
    for name, pool in (("with them", leaving.all_runs), ("without them", leaving.without)):
        if pool is not None:
            values = _with_u(pool.inertia, pool.standard_uncertainty, GRAM_METRE)
            compared += [[f"{name}: {pool.runs} runs", *values], ["u", *_two_digits(pool.standard_uncertainty)]]
    head = ["", "component", "difference from the others", "u"]
    return [
        Table("Runs that disagree with the others, g·m²", head, rows, DISCORDANCE_NOTE),
        Table("The pool with and without the runs that disagree, g·m²", ["", *COMPONENTS], compared),
    ]


def alignment(result: Identification) -> list[Table]:
    """Return delay and rotation between load cell and IMU, where they were estimated."""
    named = [("delay of the IMU, ms", result.delay, 1e3), ("rotation vector of the IMU, deg", result.rotation, DEGREE)]
    rows = [
        [f"{name}, {axis}" if len(aligned.value) > 1 else name, *figures, fixed(100 * share, 1)]
        for name, aligned, unit in named if aligned is not None and aligned.estimated
        for axis, figures, share in zip(AXES, _figures(aligned, unit), aligned.prior_share, strict=False)
    ]  # fmt: skip
    head = ["", "value", "u", "95 % interval", "prior's share, %"]
    return [Table("Alignment of load cell and IMU, estimated with the tensor", head, rows, PRIOR_NOTE)] if rows else []


def bodies(result: Identification) -> list[Table]:
    """Return the plain estimate, where the result is what bodies allow beside weak data."""
    admissible = result.admissible
    if admissible is None:
        return []
    rows = []
    plain, intervals = GRAM_METRE * admissible.plain, GRAM_METRE * admissible.plain_interval95
    for name, value, (low, high), determined in zip(COMPONENTS, plain, intervals, admissible.determined, strict=True):
        half = (high - low) / 2
        figures = [rounded(value, half), f"{rounded(low, half)} … {rounded(high, half)}"] if determined else ["–", "–"]
        rows.append([name, *figures, "yes" if determined else "no"])
    head = ["", "value", "95 % interval", "determined by the motion"]
    note = f"The result is constrained to possible tensors: {admissible.reason}."
    return [Table("Plain estimate, before the constraint to possible tensors, g·m²", head, rows, note)]


def _figures(aligned: Aligned, unit: float) -> Iterator[list[str]]:
    """Value, standard uncertainty and interval of each number."""
    for value, u, ends in zip(aligned.value, aligned.standard_uncertainty, aligned.interval95, strict=True):
        places = decimals(unit * u)
        yield [fixed(unit * value, places), fixed(unit * u, places), interval(unit * ends, places)]


def tare(result: Identification) -> list[Table]:
    """Return what was taken off, and what it was taken off from."""
    if result.tare is None:
        return []
    names, tare = ("with the fixture", "the fixture", "the body"), result.tare
    rows = [
        [name, *_with_u(parameters.values[:1], parameters.standard_uncertainty[:1], 1.0),
         *_with_u(parameters.values[1:4], parameters.standard_uncertainty[1:4], 1e3),
         *_with_u(parameters.values[4:], parameters.standard_uncertainty[4:], GRAM_METRE)]
        for name, parameters in zip(names, (tare.whole, tare.fixture, result.parameters), strict=True)
    ]  # fmt: skip
    head = ["", "mass, kg", *(f"{axis}, mm" for axis in AXES), *COMPONENTS]
    return [Table("Tare: mass, centre of gravity from Q, tensor in g·m²", head, rows, TARE_NOTE)]


def calibrations(result: Identification) -> list[Table]:
    """Return the calibrations of the rig by known bodies that the result takes."""
    experiment = result.provenance.get("experiment") or {}
    rows = [
        [entry["group"], *(str(entry.get(key, "–")) for key in ("performed", "made", "due")), str(len(entry["run"])),
         ", ".join(dict.fromkeys(run.get("body", "") for run in entry["run"]))]
        for entry in experiment.get("calibration", ())
    ]  # fmt: skip
    head = ["", "runs of", "computed", "due", "runs", "known bodies"]
    return [Table("Calibration of the rig", head, rows, CALIBRATION_NOTE, wrap=True)] if rows else []


def _with_u(values: np.ndarray, u: np.ndarray, unit: float) -> list[str]:
    """Figures to two digits of their standard uncertainty; in full where that is zero."""
    return [rounded(unit * x, unit * s) for x, s in zip(values, u, strict=True)]


def elsewhere(result: Identification) -> Iterator[Table]:
    """Return the tensor about other points and in other frames, where the mass is known."""
    if result.mass is None:
        return
    about_q, wide_about_q = result.parameters.about(), result.with_undeclared.about()
    places = [("about the load cell's centre Q, in the body frame", about_q, wide_about_q.standard_uncertainty)]
    if result.datum is not None:
        moved, wide = (ten.in_datum(result.datum) for ten in (result.parameters, result.with_undeclared))
        where = "about the centre of gravity, in the frame of the declared datum"
        places.append((where, moved.tensor, wide.tensor.standard_uncertainty))
    for where, tensor, with_undeclared in places:
        u = tensor.standard_uncertainty
        rows = [["value", *_with_u(tensor.inertia, u, GRAM_METRE)], ["u", *_two_digits(u)]]
        rows += [["u with undeclared errors", *_two_digits(with_undeclared)]] * has_bound(result)
        yield Table(f"Tensor {where}, g·m²", ["", *COMPONENTS], rows)


def checked(rows: Sequence[Sequence[str]]) -> Table:
    """Return the checks: figure, limit, verdict."""
    return Table("Checks", list(checks.HEAD), [list(row) for row in rows], wrap=True)


def _two_digits(values: np.ndarray) -> list[str]:
    return [fixed(GRAM_METRE * x, min(decimals(GRAM_METRE * x), 4)) if x else "0" for x in values]


TENSOR_NOTE = (
    "U: expanded uncertainty, half the coverage interval; k = U/u: coverage factor; ν: effective degrees of freedom "
    "(GUM G.4); p: coverage probability; u: standard uncertainty; two digits of it (GUM 7.2.6). Products: the tensor's "
    "entries."
)
BOUND_NOTE = " The bound holds undeclared errors at typical size, too; it has no coverage probability."
ORIGIN_NOTE = (
    "measured: type A, from the runs; declared: sources; model misfit: what the runs contradict; typical: undeclared "
    "errors, which the bound alone holds."
)
PRINCIPAL_NOTE = (
    "turn, deg: how well the directions of the two other axes are known, as the standard uncertainty of their angle "
    "about this one."
)
CONFORMITY_NOTE = (
    "By the conventional bound. probability within: that the value lies within the limits, from a normal distribution "
    "of its u, undeclared errors at typical size in it; –: these are not known."
)
PRIOR_NOTE = "prior's share: the part of the variance that is what was declared beforehand; 100: the data add nothing."
DISCORDANCE_NOTE = (
    "The component that differs most. A consistent set of runs is listed with a chance of 1 %. With a fixture: all "
    "that stood on the load cell."
)
TARE_NOTE = "Each tensor about its own centre of gravity; figures to two digits of their standard uncertainty."
CALIBRATION_NOTE = (
    "Errors of load cell and IMU by runs of known bodies: their means correct the result, their covariance is in its "
    "intervals."
)
BUDGET_NOTE = (
    "A: by statistics of the runs, their residuals and their scatter; B: by other means, what is declared or known "
    "beforehand (GUM 4.2, 4.3). Correlated sources make the combined one differ from the root sum of squares."
)

"""The page of an identified tensor: a certificate, as far as the table ``[report]`` makes it one."""

from collections.abc import Iterator

import numpy as np

from identify.identification import Identification
from identify.inertia import COMPONENTS
from identify.tables import decimals, fixed
from uq import checks, fit_plot, plots, sphere, sphere_plot
from uq.campaign import GRAM_METRE
from uq.certificate import Report, read
from uq.conformity import RULES, decide
from uq.contributions import contributions, shares
from uq.expanded import HEAD, Expanded, of_normal, of_tensor
from uq.front import INSTRUMENT_HEAD, front, instrument_rows
from uq.page_parts import Drawing, Page, Table, run_table, source_tables

TITLE = "Inertia tensor of a body"


def certificate(result: Identification) -> Page:
    """Return a certificate's content for an identification."""
    report = read(result.provenance)
    tensor = of_tensor(result, factor=report.coverage_factor, probability=report.coverage_probability)
    return Page(
        report.texts.get("title", TITLE),
        [UNCERTAINTY, *_decision_rule(report)],
        result.warnings,
        [
            _tensor(result, tensor),
            *_centre(result, report),
            *_conformity(result, report, tensor),
            *_instruments(report),
        ],
        list(_figures(result)),
        [*_budget(result), _checks(result), run_table(result), *source_tables(result.provenance)],
        [f"{text[0].upper()}{text[1:]}." for text in result.assumptions],
        result.provenance,
        front(report, result.provenance),
    )


def _tensor(result: Identification, tensor: Expanded) -> Table:
    """The six components, with the bias to the decimals of U."""
    rows = []
    for row, bias, half in zip(tensor.rows(GRAM_METRE), result.bias, tensor.expanded, strict=True):
        rows.append([*row[:6], fixed(GRAM_METRE * bias, decimals(GRAM_METRE * half)), row[6]])
    count = f"{len(result.runs)} run{'s' if len(result.runs) > 1 else ''}"
    title = f"Inertia tensor about the centre of gravity, in the body frame, g·m²; {count}"
    return Table(title, ["", *HEAD[:5], "bias", HEAD[5]], rows, TENSOR_NOTE)


def _centre(result: Identification, report: Report) -> list[Table]:
    """Mass and centre of gravity, as stated or measured."""
    of_cg = of_normal(
        ("centre of gravity from Q, b1, mm", "… b2, mm", "… b3, mm"), 1e3 * result.r_cg, 1e3 * result.sigma_r_cg,
        factor=report.coverage_factor, probability=report.coverage_probability,
    )  # fmt: skip
    mass = [] if result.mass is None else [["mass, kg", f"{result.mass:.6g}", *["–"] * 5]]
    return [Table("Mass and centre of gravity that were used", ["", *HEAD], [*mass, *of_cg.rows()])]


def _decision_rule(report: Report) -> list[str]:
    rule = report.conformity
    return [] if rule is None else [f"Decision rule for conformity with {rule.specification}: {RULES[rule.rule]}."]


def _conformity(result: Identification, report: Report, tensor: Expanded) -> list[Table]:
    """What the decision rule says, where a statement of conformity is asked for."""
    if report.conformity is None:
        return []
    rows = []
    for one in decide(report.conformity, tensor.value, tensor.standard, tensor.expanded):
        low, high = (f"{GRAM_METRE * end:.6g}".replace("-", "−") for end in one.limits)
        rows.append([one.component, f"{low} … {high}", one.outcome, f"{100 * one.probability:.3g}"])
    head = ["", "limits, g·m²", "outcome", "probability within, %"]
    return [Table(f"Conformity with {report.conformity.specification}", head, rows, CONFORMITY_NOTE)]


def _figures(result: Identification) -> Iterator[Drawing]:
    """Budget, residuals, coverage of the sphere, runs, and the parts of them that counted."""
    parts = contributions(result)
    if parts:
        yield Drawing("budget", shares(parts), "Who causes how much of each component's variance.")
    left = fit_plot.fit_residuals(result)
    if left is not None:
        few = len(fit_plot.drawn(result)) < len(result.runs)
        which = f" The {fit_plot.MOST} runs with the largest residuals of {len(result.runs)}." if few else ""
        yield Drawing("residuals", left, f"What the fit leaves of the moment about the centre of gravity: over time, "
                      f"and as amplitude density beside that of the moment itself.{which}")  # fmt: skip
    covered = sphere_plot.coverage(result)
    if covered is not None:
        yield Drawing("coverage", covered, _coverage_words(result))
    yield Drawing("runs", plots.estimates(result), "Each component: each run alone, and all together.")
    if any(run.overview is not None for run in result.runs):
        said = " ".join(f"{run.used}." for run in result.runs if run.used)
        yield Drawing("parts", plots.parts(result), f"The part of each run that counts. {said}")


def _coverage_words(result: Identification) -> str:
    paths = sphere.motion(result)
    assert paths is not None  # noqa: S101
    shares_ = [f"{100 * sphere.visited(path):.0f} %" for path in paths]
    least, known = sphere.rms_about(paths[1]), sphere.uncertainty_about(result)
    (weak, low), (strong, high) = least.least, least.largest
    doubtful, u = known.largest
    return (
        "Excitation over the sphere of directions, in the body frame: discs of equal area about b3, the half of −b3 "
        f"seen through from +b3. Within 15° of {shares_[0]} of all axes the angular velocity came with half its "
        f"largest magnitude or more, the angular acceleration within 15° of {shares_[1]}. Root mean square of the "
        f"angular acceleration: {low:.3g} rad/s² about {_axis(weak)}, the weakest axis, {high:.3g} about "
        f"{_axis(strong)}. The moment of inertia is least certain about {_axis(doubtful)}: u = "
        f"{GRAM_METRE * u:.2g} g·m²."
    )


def _axis(direction: np.ndarray) -> str:
    return f"({', '.join(fixed(x, 2) for x in direction)})"


def _budget(result: Identification) -> list[Table]:
    """Contributions to the standard uncertainty, and their root sum of squares."""
    parts = contributions(result)
    if not parts:
        return []
    total = np.sqrt(sum(np.square(values) for values in parts.values()))
    rows = [[name, *_two_digits(values)] for name, values in {**parts, "all": total}.items()]
    return [Table("Budget: contributions to the standard uncertainty, g·m²", ["part", *COMPONENTS], rows)]


def _two_digits(values: np.ndarray) -> list[str]:
    return [fixed(GRAM_METRE * x, min(decimals(GRAM_METRE * x), 4)) if x else "0" for x in values]


def _checks(result: Identification) -> Table:
    return Table("Checks", list(checks.HEAD), checks.rows(result), wrap=True)


def _instruments(report: Report) -> list[Table]:
    rows = instrument_rows(report.instruments) or [["not stated", *[""] * 5]]
    return [Table("Instruments and their calibration", list(INSTRUMENT_HEAD), rows, wrap=True)]


TENSOR_NOTE = (
    "U: expanded uncertainty, half the coverage interval; k = U/u: coverage factor; p: coverage probability; u: "
    "standard uncertainty. Rounded to two digits of the uncertainty (GUM 7.2.6). Products are the tensor's entries."
)
CONFORMITY_NOTE = "probability within: that the value lies within the limits, from a normal distribution of its u."
UNCERTAINTY = (
    "The standard uncertainty combines the residuals (correlated in time), the scatter between runs where it is "
    "larger, and the stated uncertainty of the centre of gravity; k follows from the normal distribution, or from "
    "Student's t where few runs tell the scatter. The bias is the expected mean error from the gyro's noise in the "
    "regressor; it is stated, not subtracted, and not contained in the interval."
)

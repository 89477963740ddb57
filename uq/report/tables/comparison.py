"""The view of a comparison with an expected tensor: deviations, E_n, and what makes the expected one uncertain."""

import numpy as np

from identify.display.reporting import Section, section_of, uncaptioned
from identify.display.rounding import exact, fixed, rounded, significant, with_uncertainty
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.bodies.comparison import Comparison
from uq.bodies.normalised_error import USUAL

EXPLAINED = ", but not beyond those with undeclared errors at typical size"
MOST = 6
"""Uncertain quantities of a reference that its table lists; result.json holds all."""
LEAST_CHANCE = 0.0001
"""Least probability that is printed as a figure."""


def title(result: Comparison) -> str:
    """Return what the table is of."""
    return f"Expected: {result.reference.name} ({result.reference.kind})"


def tables(result: Comparison) -> list[Table]:
    """Return the comparison, in g·m²."""
    head = [
        "g·m²", "expected", "U (k = 2)", "mean of runs", "standard deviation", "measured", "U", "deviation",
        "relative %", "E_n", "with undeclared",
    ]  # fmt: skip
    columns = (
        result.expected.inertia, 2 * result.expected.standard_uncertainty, result.mean, result.standard_deviation,
        result.measured.inertia, result.factor[4:] * result.measured.standard_uncertainty, result.deviation,
    )  # fmt: skip
    rows = []
    for k, name in enumerate(COMPONENTS):
        value, half, mean, spread, measured, wide, deviation = (GRAM_METRE * float(column[k]) for column in columns)
        both = float(np.hypot(half, wide)) / USUAL
        figures = [
            rounded(value, half), rounded(half, half), rounded(mean, spread), rounded(spread, spread),
            rounded(measured, wide), rounded(wide, wide), rounded(deviation, both),
        ]  # fmt: skip
        errors = result.normalised_error[k], result.normalised_error_with_undeclared[k]
        rows.append([name, *figures, fixed(100 * result.relative_error[k], 2), *(fixed(error, 2) for error in errors)])
    return [Table(f"Expected: {result.reference.name}, g·m²", head, rows, f"{summary(result)}.")]


overview = uncaptioned


def notes(result: Comparison) -> list[str]:
    """Return the joint verdict and the findings, a line each."""
    return [summary(result), *(f"warning: {text}" for text in findings(result))]


def section(result: Comparison) -> Section:
    """Return its part of a report."""
    reference = result.reference
    return section_of(
        result, title="Expected values",
        computed=[f"Beside what is expected of {reference.name}, from its {reference.kind}. {EXPECTED}"],
        findings=findings(result), details=_contributions(result),
        assumptions=["The errors of the result and of the expected value are independent."],
        provenance={**result.provenance, "expected": {"file": reference.file, "sha256": reference.sha256}},
    )  # fmt: skip


def findings(result: Comparison) -> list[str]:
    """Return what a reader must not miss."""
    explanations = [
        f"the deviation from {result.reference.name} vanishes if {suspicion.text}" for suspicion in result.suspicions
    ]
    beyond = [name for name, e in zip(COMPONENTS, result.normalised_error, strict=True) if abs(e) > 1]
    beyond += [name for name, e in result.other_errors.items() if abs(e) > 1]
    wide = [
        name for name, e in zip(COMPONENTS, result.normalised_error_with_undeclared, strict=True) if not abs(e) <= 1
    ]
    disagree = f"{', '.join(beyond)} differ{'s' * (len(beyond) == 1)} from {result.reference.name} beyond the "
    but = "" if set(beyond) & {*wide, *result.other_errors} else EXPLAINED
    return [
        *result.reference.warnings,
        *([f"{disagree}expanded uncertainties (|E_n| > 1){but}"] if beyond else []),
        *_declared_otherwise(result),
        *explanations,
    ]


def _declared_otherwise(result: Comparison) -> list[str]:
    """Return the quantities that the experiment declares as exact with other values than the reference's."""
    lines = []
    for k, name, value, u, expected, u_expected in result.known_to_both():
        unit, scale = ("kg", 1.0) if k == 0 else ("mm", 1e3)
        if u == 0 and abs(value - expected) > USUAL * u_expected:
            ours = f"{exact([scale * value])[0]} {unit}, declared without an uncertainty"
            theirs = with_uncertainty(scale * expected, scale * u_expected)
            lines.append(f"{name} is {ours} (no E_n); {result.reference.name} has {theirs} {unit}")
    return lines


def summary(result: Comparison) -> str:
    """Return the joint verdict in one line; none where the runs contradict what is declared."""
    if result.result.contradicted:
        return f"no verdict, E_n of these figures are meaningless: {result.result.contradicted}"
    statistic, freedom, probability = result.joint
    others = "".join(f"; E_n of {name} {fixed(e, 2)}" for name, e in result.other_errors.items())
    if not freedom:
        return f"no uncertainty on either side: no E_n{others}"
    chance = significant(probability, 2) if probability >= LEAST_CHANCE else f"below {LEAST_CHANCE}"
    together = f"chi-squared {significant(statistic)}, {freedom} degrees of freedom, P {chance}"
    return f"all components together: {together}{others}"


def _contributions(result: Comparison) -> list[Table]:
    """Contributions to the uncertainty of the expected tensor, the largest first, in g·m²; none where it is exact."""
    variances = result.reference.contributions
    largest = sorted(variances, key=lambda name: -float(variances[name][4:].sum()))[:MOST]
    u = {name: GRAM_METRE * np.sqrt(np.maximum(variances[name][4:], 0.0)) for name in largest}
    rows = [[name, *(significant(x, 2) for x in values)] for name, values in u.items()]
    title = "What makes the expected tensor uncertain: standard uncertainty, g·m²"
    return [Table(title, ["quantity", *COMPONENTS], rows)] if variances else []


EXPECTED = (
    "Mean and standard deviation are those of the single runs; the deviation is the result's, and E_n is the deviation "
    "over the root of the sum of squares of both expanded uncertainties (k = 2; of the result half its interval of "
    "95 %, where that is wider): satisfactory up to 1 (ISO 13528). The last column is E_n with the result's "
    "conventional bound, which holds undeclared errors at typical size."
)

"""The page of an identified tensor: a certificate, as far as the table ``[report]`` makes it one."""

from collections.abc import Iterator

import numpy as np

from identify.results.identification_result import Identification
from identify.text_tables import fixed
from uq.campaign.campaign import GRAM_METRE
from uq.coverage.expanded_uncertainty import of_tensor
from uq.experiment.conformity import RULES
from uq.experiment.report_table import Report, read
from uq.figures import campaign_figures as plots
from uq.figures import fit_figures as fit_plot
from uq.figures import sphere_axes as sphere
from uq.figures import sphere_figures as sphere_plot
from uq.figures.contributions import contributions, shares
from uq.report import certificate_tables as tables
from uq.report.certificate_front import front
from uq.report.page_parts import Drawing, Page, run_table, source_tables

TITLE = "Inertia tensor of a body"


def certificate(result: Identification) -> Page:
    """Return a certificate's content for an identification."""
    report = read(result.provenance)
    tensor = of_tensor(result, factor=report.coverage_factor, probability=report.coverage_probability)
    return Page(
        report.texts.get("title", TITLE),
        [f"{TYPE_A.get(result.method, '')} {UNCERTAINTY}".strip(), BIAS, *_decision_rule(report)],
        result.warnings,
        [
            tables.tensor(result, tensor),
            tables.mass_and_centre(result, report),
            *tables.principal(result, report),
            *tables.conformity(report, tensor),
            tables.instruments(report),
        ],
        list(_figures(result)),
        [
            *tables.budget(result),
            *tables.scatter(result),
            *tables.bodies(result),
            *tables.alignment(result),
            *tables.tare(result),
            tables.checked(result),
            *tables.elsewhere(result),
            run_table(result),
            *source_tables(result.provenance),
        ],
        [f"{text[0].upper()}{text[1:]}." for text in result.assumptions],
        result.provenance,
        front(report, result.provenance),
    )


def _decision_rule(report: Report) -> list[str]:
    rule = report.conformity
    return [] if rule is None else [f"Decision rule for conformity with {rule.specification}: {RULES[rule.rule]}."]


def _figures(result: Identification) -> Iterator[Drawing]:
    """Budget, residuals, coverage of the sphere, runs, and the parts of them that counted."""
    parts = contributions(result)
    if parts:
        yield Drawing("budget", shares(parts, result.standard_uncertainty), BUDGET)
    left = fit_plot.fit_residuals(result)
    if left is not None:
        few = len(fit_plot.drawn(result)) < len(result.runs)
        which = f" The {fit_plot.MOST} runs with the largest residuals of {len(result.runs)}." if few else ""
        yield Drawing("residuals", left, f"{RESIDUALS}{which}")
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
    of_omega, of_alpha = (f"{100 * sphere.visited(path):.0f} %" for path in paths)
    least, known = sphere.rms_about(paths[1]), sphere.uncertainty_about(result.covariance)
    (weak, low), (strong, high) = least.least, least.largest
    doubtful, u = known.largest
    certain = (
        f"The moment of inertia is least certain about {_axis(doubtful)}: u = {GRAM_METRE * u:.2g} g·m²."
        if np.isfinite(u)
        else "The moment of inertia is not determined about every axis."
    )
    return (
        "Excitation over the sphere of directions, in the body frame: discs of equal area about b3, the half of −b3 "
        f"seen through from +b3. Within 15° of {of_omega} of all axes the angular velocity came with half its "
        f"largest magnitude or more, the angular acceleration within 15° of {of_alpha}. Root mean square of the "
        f"angular acceleration: {low:.3g} rad/s² about {_axis(weak)}, the weakest axis, {high:.3g} about "
        f"{_axis(strong)}. {certain}"
    )


def _axis(direction: np.ndarray) -> str:
    return f"({', '.join(fixed(x, 2) for x in direction)})"


BUDGET = "Who causes how much of each component's variance: what the runs show (type A) and what is declared (type B)."
RESIDUALS = (
    "What the fit leaves of the moment about the centre of gravity: over time, and as amplitude density beside that of "
    "the moment itself."
)
TYPE_A = {
    "source": "What the runs show, residuals correlated in time and scatter between runs, is evaluated as type A.",
    "gls": "What the runs show is evaluated as type A: generalised least squares with the residuals' covariance across "
    "axes and in time, and the scatter between runs.",
    "joint": "Tensor, mass, centre of gravity, offsets, delay and rotation were estimated together from the residuals' "
    "noise and from what was declared of them beforehand; where the runs scatter more, that counts.",
}
"""How an estimator's uncertainty comes about, by method."""
UNCERTAINTY = (
    "What is declared and stays constant through the runs, the centre of gravity among it, is type B (GUM 4.2, 4.3, "
    "5.1). The coverage interval is from the distributions of both: k = 1.96 where they are normal, larger where few "
    "runs tell the scatter."
)
BIAS = (
    "The bias is the expected mean error from the gyro's noise in the regressor and from the declared sources. It is "
    "stated, not subtracted from the value; the interval allows for that of the sources, not for that of the noise."
)

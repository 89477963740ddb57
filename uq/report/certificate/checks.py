"""The checks of an identification: each figure, its limit, and whether it is within."""

from collections.abc import Sequence

import numpy as np

from identify.display.rounding import fixed, significant
from identify.results.identification_result import Identification
from identify.results.ledger import LARGEST_SHARE
from identify.rigid_body.inertia import GRAM_METRE
from identify.rigid_body.principal_axes import principal

HEAD = ("check", "found", "limit", "verdict")
WITHIN = "within"
"""The verdict on a check that is passed."""
NOT_DECLARED = "not declared"
"""The verdict on the check of undeclared errors that is not passed."""
UNDECLARED = "u of undeclared errors at typical size over u of all others, largest"
"""Name of the check of how much U leaves out."""


def rows(result: Identification) -> list[list[str]]:
    """Return the checks that this kind of result allows, a row each: check, figure, limit, verdict."""
    diagnostics = result.diagnostics
    checks = []
    if "excitation_over_noise" in diagnostics:
        ratio = diagnostics["excitation_over_noise"]
        checks.append(_row("motion over the gyro's noise, weakest direction", ratio, "≥", 10.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        bias = np.abs(result.bias) / (3 * result.standard_uncertainty)
    if np.isfinite(bias).all():
        checks.append(_row("largest bias over 3 u", float(bias.max()), "≤", 0.1))
    if result.pooling is not None and result.pooling.from_scatter is not None:
        ratio = float(np.max(result.pooling.excess))
        checks.append(_row("scatter between runs over that within, largest", ratio, "≤", 2.0))
    checks.append(_admissible(result))
    causes = [verdict.cause for verdict in result.consistency if not verdict.note]
    checks.append(_none("residuals that follow something", len(causes), sorted(set(causes))))
    contradicted = [record.name for record in result.declarations if record.contradicted]
    checks.append(_none("declared quantities that the runs contradict", len(contradicted), contradicted))
    checks.append(undeclared(result))
    checks.append(_none("warnings of reading and fitting", len(result.warnings)))
    return checks


def _none(what: str, count: int, names: Sequence[str] = ()) -> list[str]:
    """The check that there are none of something."""
    return [f"{what}{': ' if names else ''}{', '.join(names)}", f"{count}", "0", _verdict(not count)]


def _row(what: str, value: float, sign: str, limit: float) -> list[str]:
    within = value >= limit if sign == "≥" else value <= limit
    return [what, significant(value), f"{sign} {limit:g}", _verdict(bool(within))]


def _admissible(result: Identification) -> list[str]:
    """Positive moments and the triangle inequality, in units of what the uncertainty allows."""
    moments, _ = principal(np.asarray(result.inertia))
    margin = GRAM_METRE * float(min(moments[0], moments[0] + moments[1] - moments[2]))
    slack = 2 * GRAM_METRE * float(np.sqrt(np.nan_to_num(np.trace(result.covariance))))
    what = "a mass distribution has this tensor: least margin of moments and triangle inequality, g·m²"
    return [what, fixed(margin, 2), f"≥ {fixed(-slack, 2)}", _verdict(margin >= -slack)]


def undeclared(result: Identification) -> list[str]:
    """Return the check of errors that are neither declared nor estimated; unless they are known it is not passed."""
    share, limit = None, f"≤ {LARGEST_SHARE:.2g}"
    if result.undeclared is not None:
        share, _ = result.undeclared.share(result.parameters.standard_uncertainty)
    within = share is not None and share <= LARGEST_SHARE
    text = "not known" if share is None else significant(share, 2)
    return [UNDECLARED, text, limit, WITHIN if within else NOT_DECLARED]


def _verdict(within: bool) -> str:
    return WITHIN if within else "see Attention"

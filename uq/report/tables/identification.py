"""The view of an identification: tensor, mass and centre of gravity, runs, undeclared errors, and its figures."""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from identify.display.reporting import PAGE, Drawing, Section, section_of
from identify.display.rounding import (
    beside_uncertainty,
    common,
    decimals,
    exact,
    fixed,
    interval,
    significant,
    with_uncertainty,
)
from identify.display.text_tables import Table, counted, sentence
from identify.least_squares import offsets
from identify.results import mass_and_centre, measured_directions
from identify.results.alignment import listed
from identify.results.identification_result import Identification
from identify.results.ledger import CONVENTIONAL, LARGEST_SHARE
from identify.results.run_estimate import RunEstimate
from identify.results.weak_components import UNDETERMINED
from identify.rigid_body.fixture import Tare
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rigid_body.principal_axes import principal_axes
from uq.experiment.undeclared_table import UndeclaredTable
from uq.report.drawing import drawing

MOST_DRAWN = 4
"""Runs whose residuals are drawn."""
MOST_NOTES = 3
"""Most runs whose offsets are listed in the notes; result.json holds all."""
UNCERTIFIED = "no interval is certified, and an export needs --force"
"""Consequence of runs that contradict what is declared."""
BOUND = "conventional bound, k = 2"
"""Heading of the intervals that undeclared errors widen, at typical size."""
BEYOND = 1e3
"""Multiple of the mass, of a metre or of the largest moment above which an uncertainty is printed as not determined.

Choice: the estimate is singular there.
"""


def title(result: Identification) -> str:
    """Return quantity, runs and estimator in one line."""
    runs = counted(len(result.runs), "run")
    return f"Inertia tensor about the centre of gravity, body frame; {runs}, estimator '{result.estimator.name}'"


def tables(result: Identification) -> list[Table]:
    """Return tensor, mass and centre of gravity, each run's estimate, and what undeclared errors add."""
    validation = [] if result.validation is None else result.validation.tables()
    return [*overview(result), run_table(result), *undeclared_tables(result), *validation]


def overview(result: Identification) -> list[Table]:
    """Return the components in g·m², and mass and centre of gravity, each with both intervals."""
    bounded = has_bound(result)
    columns = zip(
        COMPONENTS, result.inertia, result.bias, result.standard_uncertainty, result.interval95, result.determined,
        strict=True,
    )  # fmt: skip
    rows = []
    for name, value, bias, uncertainty, ends, determined in columns:
        if not determined:
            rows.append([name, "–", "–", "–", UNDETERMINED])
            continue
        u = uncertainty if np.isfinite(uncertainty) else 0.1 * abs(value)
        places = decimals(GRAM_METRE * u)
        shown = beside_uncertainty(GRAM_METRE * value, GRAM_METRE * uncertainty, GRAM_METRE * u)
        figures = [fixed(GRAM_METRE * x, places) for x in (bias, uncertainty)]
        rows.append([name, shown, *figures, interval(GRAM_METRE * ends, places)])
    mass_rows = _mass_and_centre(result)
    if bounded:
        bounds = bound_texts(result, result.intervals95)
        mass_rows = [[*row, text] for row, text in zip(mass_rows, bounds[:4], strict=True)]
        columns = zip(rows, bounds[4:], result.determined, strict=True)
        rows = [[*row, ends if determined else "–"] for row, ends, determined in columns]
    head = ["value", "bias", "standard uncertainty", "95 % interval", *[BOUND] * bounded]
    caption = f"Mass and centre of gravity: {result.centre_from}"
    return [Table(trust(result), ["g·m²", *head], rows), Table(caption, ["", head[0], *head[2:]], mass_rows)]


def trust(result: Identification) -> str:
    """Return in a sentence whether the figures may be used."""
    word = verdict_word(result)
    if word == "contradicted":
        return "Do not use these figures: the runs contradict what is declared."
    if word == "warnings":
        return "Read the warnings below before you use these figures."
    return f"Nothing in the runs contradicts what is declared. {_which_to_use(result)}"


def verdict_word(result: Identification) -> Literal["not contradicted", "warnings", "contradicted"]:
    """Return the same in a word, for a script to test."""
    if result.contradicted:
        return "contradicted"
    return "warnings" if result.warnings or not all(cause.note for cause in result.consistency) else "not contradicted"


def _which_to_use(result: Identification) -> str:
    """Say which of the two to use: the intervals, or the bounds where errors that nobody declared make much of u."""
    if result.undeclared is None:
        return f"{INTERVALS_HOLD}; what undeclared errors add is not known."
    share, _ = result.undeclared.share(result.parameters.standard_uncertainty)
    if share <= LARGEST_SHARE:
        return f"{INTERVALS_HOLD}."
    return (
        "Use the conventional bounds (k = 2): the 95 % intervals leave out errors that nobody declared, whose u is up "
        f"to {significant(share, 2)} times that of all others."
    )


def has_bound(result: Identification) -> bool:
    """Return whether conventional bounds are known and differ from the coverage intervals."""
    return bool(result.undeclared and result.undeclared.rows)


def bound_texts(result: Identification, intervals: Float[np.ndarray, "10 2"]) -> list[str]:
    """Return the conventional bound of each of the ten parameters, to two digits of half of it; – for none.

    Args:
        result: with undeclared errors.
        intervals: coverage intervals that they widen [kg, m, kg·m²].
    """
    bounds = result.bounds_of(intervals)
    units = [*mass_and_centre.UNITS, *[GRAM_METRE] * 6]
    texts = []
    for ends, unit, largest in zip(bounds, units, _largest(result), strict=True):
        half = float(np.ptp(ends)) / 2
        text = interval(unit * ends, decimals(unit * half)) if half > 0 else "–"
        texts.append("not determined" if half > largest else text)
    return texts


def _largest(result: Identification) -> np.ndarray:
    """Uncertainty of each of the ten parameters above which it counts as not determined [kg, m, kg·m²]."""
    return BEYOND * np.repeat([result.mass or 1.0, 1.0, np.abs(result.inertia).max()], [1, 3, 6])


def _mass_and_centre(result: Identification) -> list[list[str]]:
    """Value, standard uncertainty and 95 % interval of mass and centre of gravity; – for what is not known."""
    ten, rows = result.parameters, []
    ends = result.intervals95
    columns = zip(
        mass_and_centre.NAMES, mass_and_centre.UNITS, ten.values, ten.standard_uncertainty, ends, strict=False
    )
    for name, unit, value, u, first in columns:
        if not np.isfinite(value):
            rows.append([name, "–", "–", "–"])
        elif u > 0:
            places = decimals(unit * u)
            figures = beside_uncertainty(unit * value, unit * u), fixed(unit * u, places)
            rows.append([name, *figures, interval(unit * first, places)])
        else:
            rows.append([name, *exact([unit * value]), "–", "–"])
    return rows


def run_table(result: Identification) -> Table:
    """Return each run's own estimate, samples, rate, residuals."""
    head = ["run", "samples", "rate, Hz", "residual, N·m", *COMPONENTS]
    rows = []
    rates = exact(run.rate for run in result.runs)
    residuals = common(float(np.sqrt(np.mean(run.residual**2))) for run in result.runs)
    for run, rate, residual in zip(result.runs, rates, residuals, strict=True):
        pairs = zip(run.inertia - result.taken_off, run.standard_uncertainty, strict=True)
        values = [fixed(GRAM_METRE * x, decimals(GRAM_METRE * u)) if run.alone else "–" for x, u in pairs]
        rows.append([run.file, f"{run.samples}", rate, residual, *values])
    return Table("Runs, components in g·m²", head, rows, RUN_NOTE)


def undeclared_tables(result: Identification) -> list[Table]:
    """Return what each error that only the conventional bounds hold adds, in g·m², g and mm, where that is known."""
    if not (result.undeclared and result.undeclared.rows):
        return []
    effects = result.undeclared.rows
    with_centre = any(effect.parameters[:4].any() for effect in effects)
    shown = slice(0 if with_centre else 4, 10)
    unit, largest = np.array([1e3, 1e3, 1e3, 1e3, *[GRAM_METRE] * 6])[shown], _largest(result)[shown]

    def row(text: str, typical: str, changes: np.ndarray, signed: bool = False) -> list[str]:
        figures = zip(unit, changes[shown], largest, strict=True)
        return [text, typical, *(two_digits(a * x, signed) if abs(x) <= most else "–" for a, x, most in figures)]

    rows = [row(effect.text, effect.figure, effect.parameters, effect.signed) for effect in effects]
    rows.append(row("together", "", result.undeclared.standard_uncertainty))
    head = ["", "typical", *(("mass", "r1", "r2", "r3") if with_centre else ()), *COMPONENTS]
    units = "g·m²; mass in g, centre of gravity in mm" if with_centre else "g·m²"
    return [Table(f"Undeclared errors at typical size: standard uncertainties, {units}", head, rows, UNDECLARED_NOTE)]


def notes(result: Identification) -> list[str]:
    """Return what was used, offsets, warnings and assumptions, a line each."""
    axes = principal_axes(result.inertia, result.covariance).note
    bodies = None if result.admissible is None else result.admissible.note
    return [
        *([f"contradicted: {result.contradicted}; {UNCERTIFIED}"] if result.contradicted else []),
        *_used(result.runs),
        *_alignment(result),
        *([] if result.tare is None else [_without(result.tare, result.parameters)]),
        *_offsets(result.runs, result.measured.standard_uncertainty[1:4]),
        *(f"warning: {text}" for text in result.warnings),
        *(
            f"note: {cause.text}; the conventional bound holds as much at typical size"
            for cause in result.consistency
            if cause.note
        ),
        *explained(result),
        *([] if bodies is None else [f"physical limits: {bodies}"]),
        *_undeclared(result),
        *([f"held out: {result.validation.text}"] if result.validation and result.validation.explained else []),
        *([] if axes is None else [f"principal axes: {axes}"]),
        *(f"assumed: {text}" for text in result.assumptions),
    ]


def explained(result: Identification) -> list[str]:
    """Return where the documentation explains the causes that are named: a line, or none."""
    places = dict.fromkeys(verdict.docs for verdict in result.consistency)
    anchors = ", ".join(f"#{place.partition('#')[2]}" for place in places)
    return [f"causes are explained in {PAGE}: {anchors}"] if places else []


def _used(runs: Sequence[RunEstimate]) -> Iterator[str]:
    """Parts that were used and samples that were left out, a text for each run of which not all was used."""
    for run in runs:
        segments = " and ".join(f"{start:.2f} to {stop:.2f} s" for start, stop in run.segments)
        out = ", ".join(f"{counted(count, 'sample')} {reason}" for reason, count in run.left_out.items() if count)
        how = ", found where it moves" if run.detected else ""
        words = [f"used from {segments}{how}"] * bool(segments) + [f"left out: {out}"] * bool(out)
        if words:
            yield f"{run.file}: {'; '.join(words)}"


def _alignment(result: Identification) -> Iterator[str]:
    """A line each for delay and rotation that were estimated."""
    delay, rotation = result.delay, result.rotation
    if delay is not None and delay.estimated:
        yield f"delay of the IMU: {listed(1e3 * delay.value, 1e3 * delay.standard_uncertainty)} ms"
    if rotation is not None and rotation.estimated:
        angles, errors = np.degrees(rotation.value), np.degrees(rotation.standard_uncertainty)
        yield f"rotation vector of the IMU against the body frame: ({listed(angles, errors)})°"


def _without(tare: Tare, body: InertialParameters) -> str:
    """Mass and centre of gravity of the body that is left without its fixture, in words."""
    u = body.standard_uncertainty
    mass = with_uncertainty(body.mass, float(u[0]))
    fixture = with_uncertainty(tare.fixture.mass, float(tare.fixture.standard_uncertainty[0]))
    centre = listed(1e3 * body.r_cg, 1e3 * u[1:4])
    return f"without the fixture of {fixture} kg: mass {mass} kg, centre of gravity ({centre}) mm"


def _offsets(runs: Sequence[RunEstimate], sigma_r_cg: np.ndarray) -> Iterator[str]:
    """A line for each run, of a few, with its offsets."""
    for run in runs if len(runs) <= MOST_NOTES else ():
        if run.offsets is not None:
            moment = listed(run.offsets.moment, offsets.uncertainty(run.offsets, sigma_r_cg))
            force = "" if run.force_offset is None else f", force ({', '.join(common(run.force_offset))}) N"
            yield f"{run.file}: offsets removed: moment about the CG ({moment}) N·m{force}"


def _undeclared(result: Identification) -> Iterator[str]:
    """A line on the undeclared error that widens an interval most; where none is known, on the size of one of them."""
    if result.undeclared is None:
        scale, k = UndeclaredTable().gyro_scale or 0.0, int(np.argmax(np.abs(result.inertia) * result.determined))
        half = two_digits(GRAM_METRE * CONVENTIONAL * scale * float(np.abs(result.inertia[k])))
        cure = "" if result.provenance else "; uq.with_undeclared(result, runs, experiment) adds them all"
        yield (
            f"undeclared errors are not in these intervals: the gyro's scale alone, at a typical {100 * scale:g} %, "
            f"adds ± {half} g·m² to {COMPONENTS[k]}{cure}"
        )
    gap = result.undeclared and result.undeclared.largest(result.parameters.standard_uncertainty)
    if gap:
        yield gap.text


def two_digits(value: float, signed: bool = False) -> str:
    """Return a figure to two digits; ``signed``: with its sign, since it is a bias."""
    sign = "+" if signed and value > 0 else ""
    return "0" if value == 0 else sign + fixed(value, max(min(decimals(abs(value)), 6), 0))


def drawings(result: Identification) -> list[Drawing]:
    """Return budget, moment, residuals, coverage of the sphere, runs, and the parts of them that counted."""
    runs, parts, largest = result.runs, result.contributions, largest_residuals(result.runs)
    paths = measured_directions.motion(runs)
    shown = []
    if parts:
        shown.append(drawing("budget", BUDGET, "identification.shares", parts, result.standard_uncertainty))
    if largest:
        few = f" The {MOST_DRAWN} runs with the largest residuals of {len(runs)}." if len(largest) < len(runs) else ""
        shown.append(drawing("moment", f"{MOMENTS}{few}", "identification.moments", largest))
        shown.append(drawing("residuals", f"{RESIDUALS}{few}", "identification.residuals", largest))
    if paths is not None:
        caption = _coverage_caption(*paths, result.covariance)
        shown.append(drawing("coverage", caption, "sphere.coverage", *paths, result.covariance))
    if sum(run.alone for run in runs) > 1:
        estimates = (runs, result.inertia, result.interval95, result.taken_off)
        shown.append(drawing("runs", RUNS, "identification.estimates", *estimates))
    if any(run.overview is not None for run in runs):
        used = " ".join(f"{text}." for text in _used(runs))
        shown.append(drawing("parts", f"The part of each run that counts. {used}", "identification.parts", runs))
    return [*shown, *([] if result.validation is None else result.validation.drawings())]


def largest_residuals(runs: Sequence[RunEstimate]) -> list[RunEstimate]:
    """Return the runs whose residuals are drawn: those with the largest, in the order given."""
    traced = [run for run in runs if run.trace is not None]
    largest = sorted(traced, key=lambda run: -float(np.sum(run.residual**2)))[:MOST_DRAWN]
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


def section(result: Identification) -> Section:
    """Return its part of a report; :class:`uq.report.certificate.certificate.Certificate` makes it a certificate."""
    return section_of(result, assumptions=list(map(sentence, result.assumptions)))


INTERVALS_HOLD = "The 95 % intervals hold if the assumptions below do"
RUNS = "Each component: each run alone, and all together."
BUDGET = "Contributions to each component's variance: what the runs show (type A) and what is declared (type B)."
MOMENTS = (
    "Moment about the centre of gravity in the middle of each run: measured, less the offset, and predicted by the "
    "tensor; force and moment of runs that the tensor has not seen: --validate."
)
RESIDUALS = (
    "What the fit leaves of the moment about the centre of gravity: over time, and as amplitude density beside that of "
    "the moment itself."
)
RUN_NOTE = "Each run alone; –: it does not identify the whole tensor. The files' hashes stand under Provenance."
UNDECLARED_NOTE = (
    "Neither declared as a source nor estimated: the conventional bounds hold them. To first order; with a sign: a "
    "bias, which counts as a standard uncertainty; –: not determined. The figures are those of [undeclared]."
)

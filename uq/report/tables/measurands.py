"""The views of small results: bodies, a bound, a model's law, distributions and indices, tests, a sensor's noise."""

import numpy as np

from identify.display.reporting import Drawing, Section, uncaptioned
from identify.display.rounding import beside_uncertainty, common_power, in_power, rounded, significant, with_uncertainty
from identify.display.text_tables import Table
from identify.estimation.joint.cramer_rao_bound import Bound
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import InertialParameters
from uq.analysis.propagation.law_of_propagation import LinearLaw
from uq.analysis.propagation.propagation_of_distributions import Propagation
from uq.analysis.sensitivity.sobol_shapley import Sensitivity
from uq.analysis.sensitivity.variance_shares import Indices
from uq.bodies.export import Exported
from uq.bodies.reference import Reference
from uq.files.units import printed
from uq.report.drawing import drawing
from uq.runs.recorded.still_noise import StillNoise
from uq.sources.quasi_random import REPLICATES


def parameters_tables(ten: InertialParameters) -> list[Table]:
    """Return mass in kg, centre of gravity in mm and tensor in g·m², with their standard uncertainties."""
    names = ["mass, kg", *(f"CG {k}, mm" for k in (1, 2, 3)), *(f"{name}, g·m²" for name in COMPONENTS)]
    shown = np.array([1.0, *[1e3] * 9])
    return [Table("", names, [list(map(with_uncertainty, shown * ten.values, shown * ten.standard_uncertainty))])]


def reference_title(reference: Reference) -> str:
    """Return its name and kind."""
    return f"{reference.name} ({reference.kind})"


def reference_tables(reference: Reference) -> list[Table]:
    """Return its parameters with their standard uncertainties."""
    return parameters_tables(reference.parameters)


def exported_tables(exported: Exported) -> list[Table]:
    """Return the files by format."""
    rows = [list(record.values()) for record in exported.records()]
    return [Table("Exported files", ["format", "file", "what"], rows)]


exported_overview = uncaptioned


def exported_notes(exported: Exported) -> list[str]:
    """Return the warnings, a line each."""
    return [f"warning: {text}" for text in exported.warnings]


def exported_section(exported: Exported) -> Section:
    """Return its part of a report."""
    tables = exported_tables(exported)
    return Section("Exported files", (), exported.warnings, details=tables, provenance=exported.provenance)


def bound_title(bound: Bound) -> str:
    """Return the heading: which unknowns are free."""
    return f"Hybrid Cramér–Rao bound; free: {', '.join(bound.free)}"


def bound_tables(bound: Bound) -> list[Table]:
    """Return three standard uncertainties of the tensor in g·m²."""
    three = 3 * GRAM_METRE * bound.standard_uncertainty("inertia")
    return [Table("", ["g·m²", *COMPONENTS], [["3σ at least", *map(significant, three)]])]


def linear_law_tables(law: LinearLaw) -> list[Table]:
    """Return estimate, standard uncertainty, interval and each input's contribution, a row per component."""
    columns, power = law.columns(), common_power(law.standard_uncertainty.ravel())
    rows = []
    for value, u, low, high, freedom, *parts in zip(*columns.values(), strict=True):
        value, u, low, high, *parts = (x / 10.0**power for x in (value, u, low, high, *parts))
        ends = (rounded(low, u), rounded(high, u))
        row = [beside_uncertainty(value, u), rounded(u, u), *ends, significant(freedom)]
        rows.append([*row, *(rounded(x, u) for x in parts)])
    return [Table(in_power(power), list(columns), rows)]


def propagation_title(result: Propagation) -> str:
    """Return what the table is of."""
    return f"Monte Carlo, {result.trials:,} trials in {result.stability.blocks} blocks, seed {result.seed}"


def propagation_tables(result: Propagation) -> list[Table]:
    """Return estimate, standard uncertainty, both intervals and tolerance, a row per component."""
    percent = f"{100 * result.symmetric.probability:g} %"
    head = ["estimate", "u", f"{percent} from", "to", "shortest from", "to", "tolerance"]
    power, rows = common_power(result.standard_uncertainty.ravel()), []
    for record in result.records():
        value, u, *ends, tolerance = (x / 10.0**power for x in record.values())
        figures = [beside_uncertainty(value, u), rounded(u, u), *(rounded(end, u) for end in ends)]
        rows.append([*figures, significant(tolerance, 2)])
    return [Table(in_power(power), head, rows)]


def propagation_notes(result: Propagation) -> list[str]:
    """Return the warnings, a line each."""
    return list(result.warnings)


def sensitivity_title(result: Sensitivity) -> str:
    """Return what the table is of."""
    failed = f"; {result.failed} failed and are left out" if result.failed else ""
    how = f"{result.trials:,} {result.points} trials, {result.evaluations:,} evaluations{failed}"
    return f"Shares of the variance, {how}"


def sensitivity_tables(result: Sensitivity, output: int | None = None) -> list[Table]:
    """Return indices with standard errors of one output, or of all outputs together (None)."""
    columns = [_column(indices, output) for indices in result.indices.values()]
    cells = [map(with_uncertainty, *column) for column in columns]
    sums = [with_uncertainty(float(values.sum()), np.nan) for values, _ in columns]
    rows = [*map(list, zip(result.players, *cells, strict=True)), ["sum", *sums]]
    return [Table("", ["input", *result.indices], rows)]


def sensitivity_notes(result: Sensitivity) -> list[str]:
    """Return what the effects add up to."""
    closure = ", ".join(map(with_uncertainty, result.closure, result.closure_standard_error))
    notes = [f"closure (sum of the effects over the sample variance, by output): {closure}"]
    return [*notes, SPREAD] if result.points == "quasi-random" else notes


def _column(indices: Indices, output: int | None) -> tuple[np.ndarray, np.ndarray]:
    if output is None:
        return indices.generalised, indices.generalised_standard_error
    return indices.value[:, output], indices.standard_error[:, output]


def noise_title(result: StillNoise) -> str:
    """Return what the tables are of."""
    return f"Noise of {result.file} at rest, {significant(result.seconds)} s"


def noise_tables(result: StillNoise) -> list[Table]:
    """Return N, B and K of each channel with their intervals, drift and step; then the spectral lines."""
    rows, lines = [], []
    for channel in result.channels:
        noise, quantity = channel.noise, channel.quantity.replace("omega", "ω")
        row = [f"{quantity}{channel.axis + 1}, {printed(channel.unit)}"]
        for value, (low, high) in zip(noise.values, noise.interval95, strict=True):
            half = (high - low) / 2
            ends = f"{rounded(low, half)} … {rounded(high, half)}" if low > 0 else f"< {significant(high, 2)}"
            row += [rounded(value, half) if low > 0 else "–", ends]
        drift = with_uncertainty(3600 * noise.drift, 3600 * noise.drift_uncertainty)
        rows.append([*row, drift, significant(noise.step) if noise.step else "–"])
        lines += [
            [row[0], significant(line.frequency, 4), with_uncertainty(line.amplitude, line.standard_uncertainty)]
            for line in noise.lines[:MOST_LINES]
        ]
    head = ["", "white N, s^½", "95 %", "flicker B", "95 %", "random walk K, s^-½", "95 %", "drift an hour", "step"]
    spectral = [Table("Spectral lines, the largest of each channel", ["", "Hz", "amplitude"], lines)] if lines else []
    return [Table("Noise of each channel", head, rows, NOISE_NOTE), *spectral]


def noise_notes(result: StillNoise) -> list[str]:
    """Return the warnings, a line each."""
    return [f"warning: {text}" for text in result.warnings]


def noise_drawings(result: StillNoise) -> list[Drawing]:
    """Return the Allan deviations with their fit."""
    return [drawing("allan", ALLAN, "recordings.allan_deviations", result.channels)]


MOST_LINES = 3
"""Lines of a channel that a table shows; result.json holds all."""
ALLAN = (
    "Overlapping Allan deviation of each channel (points) and that of the fitted white noise, flicker and random walk "
    "(lines). Above a tenth of the recording points scatter, and lie low: the straight line of the drift is taken off."
)
NOISE_NOTE = (
    "N, B and K as in IEEE Std 952, from a spectrum by the likelihood of Whittle; the signal's unit times that of the "
    "heading. <: not seen, with an upper limit of 95 %. Drift: the straight line through the recording."
)
SPREAD = (
    f"standard errors: from the spread of {REPLICATES} replicates, times √({REPLICATES - 1}/{REPLICATES - 3}), the "
    f"standard deviation of Student's t; within two of them in 95 of 100 cases."
)

"""Rivals of a cause: errors of the rig that change a run in the same way, each with its cure and effect on the tensor.

The run cannot tell them apart; the reader, who knows the rig, can.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.display.rounding import significant
from identify.errors.body.mass import MASS
from identify.errors.error_model import ErrorModel
from identify.errors.imu.imu_axes import IMU_AXES
from identify.errors.load_cell.gain import GAIN
from identify.errors.load_cell.load_cell_axes import LOAD_CELL_AXES
from identify.errors.written_sizes import ROUNDING
from identify.estimation.joint.error_columns import ErrorColumns
from identify.estimation.joint.predicted_wrench import PredictedWrench
from identify.judge.evidence import Evidence, NullModel
from identify.judge.findings import signed
from identify.judge.run_fit import RunFit, tensor_change
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE

OTHER_WEIGHT = 0.025
"""Part of the mass up to which gravity of another place or air may feign it.

Choice: gravity changes by half a per cent over the earth, and a body of 60 kg/m³ loses two per cent to the air.
"""


class Rival(NamedTuple):
    """An error of the rig that the run cannot tell from a cause."""

    what: str
    cure: str
    added: Float[np.ndarray, "n 6"]
    """Change of the measured wrench by it [N], [N·m]."""


class JudgedWay(NamedTuple):
    """Runs at their best by one way to have their specific force."""

    fits: Sequence[RunFit]
    base: NullModel
    """The unknowns of all runs at their best together."""


def rivals(evidence: Evidence, run: PredictedWrench) -> list[Rival]:
    """Return what a run cannot tell from a cause of this evidence."""
    make = MADE.get(evidence.error)
    return [] if make is None else make(evidence.values, run)


def _of_imu_axes(turn: np.ndarray, run: PredictedWrench) -> list[Rival]:
    """The load cell turned against the body, in place of the IMU."""
    turned = ErrorColumns(run).columns(LOAD_CELL_AXES) @ -turn
    return [Rival("a rotation of the load cell", "correct wrench_rotation_to_body", turned)]


def _of_mass(missing: np.ndarray, run: PredictedWrench) -> list[Rival]:
    """Gain, a part beside the body, gravity and air, of the same weight as a mass that is missing in the declared."""
    kg, share = float(missing[0]), float(missing[0] / run.x["mass"][0])
    gain = f"gains of the load cell of {signed(100 * share)} %"
    added = ErrorColumns(run).columns(GAIN) @ np.full(GAIN.count, share)
    others = [Rival(gain, "calibrate it, or declare a scale of F and M", added)]
    if kg > 0:
        others.append(_part_at_q(kg, run))
    if run.force_from == "still" and abs(share) < OTHER_WEIGHT:
        up = run.gravity * run.signals.up
        weight = kg * np.hstack([up, np.cross(run.x["r_cg"], up)])
        gravity = significant(run.gravity * (1 + share), 4)
        others.append(Rival(f"gravity of {gravity} m/s²", "correct platform.gravity", weight))
        if kg < 0:
            lift = significant(-kg * run.gravity, 2)
            others.append(Rival(f"{lift} N by which air lifts the body", "state body.mass as weighed in air", weight))
    return others


def _part_at_q(kg: float, run: PredictedWrench) -> Rival:
    """A part at Q that the declared mass does not have, such as an adapter."""
    force = kg * (run.specific_force - run.signals.levers @ run.x["r_cg"])
    return Rival(
        f"{significant(kg, 2)} kg at Q beside the body, such as an adapter",
        "state it with its place in [fixture], and add it to body.mass and r_cg_from_q",
        np.hstack([force, np.zeros_like(force)]),
    )  # fmt: skip


MADE: dict[ErrorModel, Callable[[np.ndarray, PredictedWrench], list[Rival]]] = {
    IMU_AXES: _of_imu_axes,
    MASS: _of_mass,
}
"""Functions that make the rivals of a cause, by its coefficients in SI."""


def tensor_shift(
    result: Identification, weights: Sequence[float], way: JudgedWay, added: Sequence[np.ndarray]
) -> Float[np.ndarray, "6"]:
    """Return the error that a change of the measured wrench of each run makes in the tensor of a result [kg·m²]."""
    columns = [change[:, :, None] for change in added]
    if result.method != "joint":
        return tensor_change(way.fits, weights, columns)[:, 0]
    lines = [fit.transformed(part) for fit, part in zip(way.fits, columns, strict=True)]
    return np.asarray(way.base.ten @ way.base.project_out(lines).by_shared)[4:, 0]


def effect(shift: Float[np.ndarray, "6"], standard_uncertainty: Float[np.ndarray, "6"]) -> str:
    """Return what an error does to the tensor, in words: the component that it shifts most, in its uncertainty.

    Args:
        shift: of the packed tensor [kg·m²].
        standard_uncertainty: of the result [kg·m²].
    """
    ratio = np.abs(shift) / np.nan_to_num(standard_uncertainty).clip(1e-300)
    worst = int(np.argmax(ratio))
    if ratio[worst] <= ROUNDING:
        return "it would not shift the tensor"
    return f"it would shift {COMPONENTS[worst]} by {signed(GRAM_METRE * shift[worst])} g·m²"


def rivals_text(result: Identification, weights: Sequence[float], way: JudgedWay, evidence: Evidence) -> str:
    """Return a cause's rivals with their cures, and what each does to the tensor; "": the cause has none.

    Args:
        result: that is judged.
        weights: of each run in the pooled tensor.
        way: by which the runs follow the cause.
        evidence: for the cause.
    """
    by_run = [rivals(evidence, fit.prediction) for fit in way.fits]
    texts = []
    for same in zip(*by_run, strict=False):
        shift = tensor_shift(result, weights, way, [rival.added for rival in same])
        texts.append(f"{same[0].what} ({same[0].cure}; {effect(shift, result.standard_uncertainty)})")
    runs = "run" if len(way.fits) == 1 else "runs"
    return f"; the {runs} cannot tell it from {', or '.join(texts)}" * bool(texts)

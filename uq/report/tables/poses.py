"""The view of planned static poses: where to go, and what they promise."""

from dataclasses import replace

import numpy as np

from identify.display.reporting import Section, section_of
from identify.display.rounding import fixed, significant
from identify.display.text_tables import Table
from identify.estimation.static_poses.centre_result import PARAMETERS, UNITS
from uq.plan.measurement.pose_plan import PosePlan


def tables(plan: PosePlan) -> list[Table]:
    """Return predicted standard uncertainties beside those of the naive poses."""
    rows = []
    for name, unit, designed, other in zip(
        PARAMETERS, UNITS, plan.standard_uncertainty, plan.naive_standard_uncertainty, strict=True
    ):
        scale, shown = {"m": (1e3, "mm"), "kg": (1e3, "g")}.get(unit, (1.0, unit))
        pair = [significant(scale * designed), significant(scale * other)]
        rows.append([name, shown, *pair, fixed(100 * (designed / other - 1), 1)])
    title = "Static poses for mass and centre of gravity: what they promise"
    return [Table(title, ["", "u in", "designed", "naive", "change, %"], rows, POSE_NOTE)]


def overview(plan: PosePlan) -> list[Table]:
    """Return the poses, then what they promise."""
    return [replace(table, caption="") for table in (_poses(plan), *tables(plan))]


def notes(plan: PosePlan) -> list[str]:
    """Return which poses are the same, and why."""
    return [f"note: {text}" for text in _repeated(plan)]


def section(plan: PosePlan) -> Section:
    """Return its part of a report."""
    return section_of(
        plan, title="Static poses", findings=_repeated(plan), details=[_poses(plan)], assumptions=[AVERAGED]
    )


def _repeated(plan: PosePlan) -> list[str]:
    if not (repeats := plan.repeats()):
        return []
    sets = "; ".join(f"{', '.join(map(str, numbers[:-1]))} and {numbers[-1]}" for numbers in repeats)
    return [f"poses {sets} are the same: {REPEATED}"]


def _poses(plan: PosePlan) -> Table:
    """Position, attitude and lengths of the legs of each pose."""
    rows = [
        [f"{k}", *(fixed(1e3 * x, 2) for x in p), *(fixed(a, 3) for a in turn), *(fixed(1e3 * x, 2) for x in legs)]
        for k, (p, turn, legs) in enumerate(zip(plan.position, np.degrees(plan.angles), plan.length, strict=True), 1)
    ]
    legs = [f"leg {k}, mm" for k in range(1, 7)]
    head = ["pose", "x, mm", "y, mm", "z, mm", "roll, °", "pitch, °", "yaw, °", *legs]
    return Table(f"Static poses to run, {plan.hold:g} s each", head, rows)


REPEATED = (
    "few directions determine mass and centre best, and repeating them does more than others would. Go to each anew."
)
POSE_NOTE = (
    "naive: as many poses level and along ±x, ±y. The list, poses.csv, is read by inertia centre once the mean force "
    "and moment of each pose are filled in."
)
AVERAGED = "Force and moment of a static pose are averaged; its noise is white and its constant offsets are estimated."

"""The moment is about another point than Q, or the declared centre of gravity is wrong.

## What it looks like

Force and moment put the centre of gravity millimetres or centimetres from where the experiment declares it.

## Why it matters

The tensor about the centre of gravity lacks m d² of the distance d. A load cell's origin is often at its face, inside
it, or at the tool.

## How it is decided

The centre of gravity follows from `M = r × F` and the motion, with its covariance. Named from 3 mm and a chi-square of
40, with the declared uncertainty and 1 mm besides. Directions that the motion does not determine do not count; their
coordinates are `?`. A unit of the moment, or its sign alone, that explains it as well is named beside it.

## What to do

Set `wrench_point` to the point where the load cell takes its moment, or correct `body.r_cg_from_q`. The data sheet of
the load cell decides.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identify.judge.conventions.axis_hypotheses import EQUAL, Hypothesis, chi_square, scales
from identify.judge.conventions.examined_run import ExaminedRun
from identify.judge.conventions.findings.sign import alone
from identify.judge.conventions.free_rotation import CERTAIN_SHIFT
from identify.judge.cure import Cure, Entries, as_well
from identify.judge.findings import Finding


class OtherPoint(Finding):
    """A moment about another point than Q."""

    distance: float
    """Distance of the centre of gravity from the declared one [m]."""
    point: Sequence[float | None]
    """Point of the moment from Q [m]; None: a coordinate that the motion does not determine."""
    fits_as_well: Sequence[Entries | Cure] = ()
    """Settings that explain it as well."""

    @property
    def looks(self) -> str:
        return f"force and moment put the centre of gravity {1e3 * self.distance:.1f} mm from the declared one"

    @property
    def cure(self) -> Cure:
        unknown = "; the motion does not determine coordinates marked ?" * (None in self.point)
        then = f"{unknown}, or correct body.r_cg_from_q{as_well(self.fits_as_well)}"
        return Cure(question="is the moment about another point than Q?", choices=[point_entry(self.point)], then=then)


EXAMPLES = (OtherPoint(topic="/wrench", distance=0.031, point=[0.001, None, -0.031]),)


def point_entry(point: Sequence[float | None]) -> Entries:
    """Return the key that declares a point of the moment, from Q [m]."""
    return Entries({"wrench_point": [None if x is None else f"{1e3 * x:.1f} mm" for x in point]})


def other_point(run: ExaminedRun) -> Iterator[Finding]:
    """Yield the finding on a moment about another point than Q, with its rivals: a unit, a reversed moment."""
    place = run.elsewhere()
    if place is not None:
        distance, point = place
        rivals = [*run.units_instead, *_moment_alone(run)]
        yield OtherPoint(topic=run.wrench, distance=distance, point=point, fits_as_well=rivals)


def _moment_alone(run: ExaminedRun) -> list[Entries]:
    """The key that gives the moment alone the other sign, where this puts the centre of gravity as declared."""
    if run.shift(mirrored=True)[1] > CERTAIN_SHIFT:
        return []
    given, other = scales(run.sums, weight=True), Hypothesis("wrench", -np.eye(3), 0.0, accelerometer=-1.0)
    worse = chi_square(other.applied(run.sums), given) - chi_square(run.sums, given)
    reading = alone("moment", run.declared)
    assert isinstance(reading.cure, Entries)  # noqa: S101 - of a signal alone it is the calibration
    return [replace(reading.cure, remark=f" ({reading.words})")] if worse < EQUAL else []

"""Force, moment, acceleration or gravity has the reversed sign.

## What it looks like

Newton's and Euler's equations hold only with the other sign of one signal, or of two.

## Why it matters

A sensor that states the reaction on itself gives a negative mass, and a tensor of negative moments. If one signal
alone is reversed, the centre of gravity lies on the other side of Q.

## How it is decided

By the sums of the run: another sign must explain it better than as declared by a factor of exp(30) in likelihood. (F,
f, r) and (-F, -f, -r) obey the same equations, so that two signals alone do not tell which is reversed. The
accelerometer's reading along a recorded attitude, and the declared centre of gravity, decide where they can. Otherwise
the message names each, with the centre of gravity that it gives.

## What to do

Set `wrench`, `accelerometer_at_rest` or `calibration` as the message has it. Where it has several: the reading of the
accelerometer at rest, up, and of the load cell under a known load decide.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.judge.conventions.axis_hypotheses import DECISIVE, Hypothesis
from identify.judge.conventions.convention_fit import DeclaredRig
from identify.judge.conventions.examined_run import ON_SENSOR, ExaminedRun
from identify.judge.cure import Cure, Entries, Opposite, as_well
from identify.judge.findings import Finding


class SignReading(NamedTuple):
    """Signals that may have the other sign: force F, moment M and specific force f, of which two alone do not tell.

    (F, f, r) and (-F, -f, -r) obey the same equations.
    """

    words: str
    cure: Entries | str
    mirrored: bool = False
    """Whether the centre of gravity lies on the other side of the moment's point."""
    downwards: bool = False
    """Whether the accelerometer reads downwards at rest."""


DOWN = Entries({"accelerometer_at_rest": Opposite("down", "up")})
DECIDES = "the accelerometer's reading at rest, a recorded attitude or a declared body.r_cg_from_q decides"
DECIDES_AT_REST = "the sensors' readings under a known load, or a declared body.r_cg_from_q, decide"
WRENCH = SignReading("force and moment have the reversed sign", ON_SENSOR)
DOWNWARDS = SignReading("the accelerometer reads downwards at rest", DOWN, downwards=True)
BOTH = SignReading(
    f"{WRENCH.words} and {DOWNWARDS.words}", Entries({**ON_SENSOR.values, **DOWN.values}), downwards=True
)


def alone(signal: str, declared: DeclaredRig) -> SignReading:
    """Return the reading that force or moment alone have the other sign."""
    signs = np.where(np.arange(6) // 3 == ("force", "moment").index(signal), -1.0, 1.0)
    rows = (signs[:, None] * declared.calibration + 0.0).tolist()
    return SignReading(f"the {signal} alone has the reversed sign", Entries({"calibration": rows}), mirrored=True)


class ReversedSign(Finding):
    """Signals that have the other sign."""

    readings: Sequence[SignReading]
    """Ways to reverse signals that fit, the likelier first."""
    places: Sequence[str]
    """Centre of gravity by each, in words."""
    why: str
    """Clause on what refuted others, where one is left."""
    same_tensor: bool
    """Whether all give the same tensor."""
    at_rest: bool
    """Whether the data are static poses."""
    fits_as_well: Sequence[Entries | Cure] = ()
    """Other axes of the wrench that fit as well."""

    @property
    def _several(self) -> bool:
        return len(self.readings) > 1

    @property
    def looks(self) -> str:
        by = "the attitudes" if self.at_rest else "gravity and the motion"
        words = ", or ".join(
            f"{reading.words}{f' ({place})' * self._several}"
            for reading, place in zip(self.readings, self.places, strict=True)
        )
        fit = f"fit {'either' if len(self.readings) == 2 else 'each'}" if self._several else f"fit only so{self.why}"
        fit += ", with the same tensor" * (self._several and self.same_tensor)
        return (
            f"force, moment and accelerometer or attitude contradict each other in sign: {words}; {by} "
            f"{fit}{as_well(self.fits_as_well)}"
        )

    @property
    def cure(self) -> Cure:
        decides = f"; {DECIDES_AT_REST if self.at_rest else DECIDES}" * self._several
        return Cure(choices=[reading.cure for reading in self.readings], then=decides)


EXAMPLES = (
    ReversedSign(topic="/wrench", readings=[WRENCH], places=[""], why="", same_tensor=False, at_rest=False),
    ReversedSign(
        topic="/imu",
        readings=[DOWNWARDS, alone("force", DeclaredRig())],
        places=["centre of gravity at (1.2, 0.3, 53.0) mm", "centre of gravity at (-1.2, -0.3, -53.0) mm"],
        why="",
        same_tensor=True,
        at_rest=False,
    ),
)


def sign_finding(run: ExaminedRun, fits: Sequence[Hypothesis], upside_down: SignReading | None) -> Finding:
    """Return the finding on signals of the other sign: the readings that fit and that no declaration refutes.

    Args:
        run: under examination, whose sums are those of the best fit; afterwards those of the likeliest reading.
        fits: axes and signs that fit, the best first.
        upside_down: reading of the attitudes of static poses with the other sign; None: it is a run.
    """
    same = [fit for fit in fits if fit.sensor == "wrench" and np.allclose(abs(fit.matrix), abs(fits[0].matrix))]
    readings = [reading for fit in same for reading in _readings(fit, run.declared, upside_down)]
    readings, why = _decided(run, list({reading.words: reading for reading in readings}.values()))
    places = [run.place(mirrored=reading.mirrored) for reading in readings]
    if readings[0].mirrored:
        run.sums = run.sums.mirrored(run.declared.wrench_point)
    return ReversedSign(
        topic=run.imu if readings[0].downwards else run.wrench, readings=readings, places=places, why=why,
        same_tensor=len(same) == 1 and not run.at_rest, at_rest=run.at_rest,
        fits_as_well=run.rivals([fit for fit in fits[1:] if fit not in same]),
    )  # fmt: skip


def _readings(fit: Hypothesis, declared: DeclaredRig, upside_down: SignReading | None) -> list[SignReading]:
    """The signs that would make force, moment and specific force fit as a hypothesis does."""
    proper = np.linalg.det(fit.matrix) > 0
    if upside_down is not None:
        return [WRENCH, upside_down, alone("force", declared)]
    if fit.accelerometer > 0:
        return [] if proper else [WRENCH]
    return [DOWNWARDS, alone("force", declared)] if proper else [alone("moment", declared), BOTH]


def _decided(run: ExaminedRun, readings: list[SignReading]) -> tuple[list[SignReading], str]:
    """The readings that attitude and declared centre of gravity leave, and what refuted the others."""
    possible, why = readings, []
    if not run.declared.measured:
        possible = [reading for reading in possible if not reading.downwards] or possible
    elif run.upward:
        possible = [reading for reading in possible if reading.downwards == (run.upward < 0)] or possible
        why += ["the attitude"]
    mirrored, certain = _mirrored_as_declared(run)
    if certain and any(reading.mirrored == mirrored for reading in possible):
        possible = [reading for reading in possible if reading.mirrored == mirrored]
        why += ["the declared centre of gravity"]
    possible.sort(key=lambda reading: mirrored is not None and reading.mirrored != mirrored)  # the likelier ones first
    return possible, f", by {' and '.join(why)}" * (len(possible) < len(readings) and bool(why))


def _mirrored_as_declared(run: ExaminedRun) -> tuple[bool | None, bool]:
    """Whether the mirrored centre is nearer to the declared one, None where there is none; and if for certain."""
    if run.declared.r_cg is None:
        return None, False
    plain, mirrored = (run.shift(mirrored=turned)[1] for turned in (False, True))
    return mirrored < plain, abs(plain - mirrored) > DECISIVE / 2

"""How far clean runs stay from the limits of the judge: each limit beside what runs without any error reach.

Runs of tests/helpers/laboratory.py, 30 s each. The docstrings of the constants in ``identify/judge`` cite these figures.

    python -m tests.helpers.judge_margins --runs 100    # 5 minutes of processor time
"""

import argparse

import numpy as np

from identify.judge import causes, judged_result
from identify.judge.conventions import (
    axis_hypotheses,
    examined_run,
    free_rotation,
    imu_conventions,
    removed_weight,
)
from identify.judge.conventions.convention_fit import (
    FORCE,
    MOMENT,
    MOMENT_TERMS,
    DeclaredRig,
    ImuSignal,
    WrenchSignal,
    convention_sums,
)
from identify.judge.conventions.findings.mass import MASS_TOLERANCE
from identify.judge.findings import MATTERS
from identify.judge.judged_fits import lasting
from identify.judge.run_findings import resonance
from identify.judge.run_findings.least_squares import DIFFERENT, least_squares_difference
from identify.judge.run_findings.unexplained import UNEXPLAINED
from identify.signals.power_spectrum import welch
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_mechanics import GRAVITY
from tests.helpers.laboratory_runs import identified, run_of

LIMITS = {
    "lasting force over the weight": ("≥", removed_weight.LEAST_WEIGHT),
    "gravity's turn by the gyro over that by the accelerometer": ("≤", imu_conventions.UNLIKE),
    "magnitude of specific force, median deviation, in parts": ("≤", imu_conventions.STEADY),
    "specific force without a lever's, in parts": ("≥", imu_conventions.WITHOUT_GRAVITY),
    "log Bayes factor of the best cause": ("≤", causes.LIKELY),
    "chance of the best cause": ("≥", causes.CHANCE),
    "residuals in the band over those above": ("≤", UNEXPLAINED),
    "chance of least squares' difference": ("≥", DIFFERENT),
    "part of what lies above the motion's band in one peak": ("≤", resonance.MOST),
    "chi-square of other axes, less that as declared": ("≥", -axis_hypotheses.DECISIVE),
    "chi-square of a small turn": ("≤", free_rotation.CERTAIN_SHIFT),
    "small turn, deg": ("≤", float(np.degrees(free_rotation.LEAST_TURN))),
    "force that no rigid body explains, in parts": ("≤", free_rotation.NOT_RIGID),
    "moment that no rigid body explains, in parts": ("≤", free_rotation.NOT_RIGID),
    "chi-square of another point": ("≤", free_rotation.CERTAIN_SHIFT),
    "distance to another point, m": ("≤", examined_run.LEAST_SHIFT),
    "departure of the force from the weight, in parts": ("≤", MASS_TOLERANCE),
    "likeness of force and specific force": ("≥", removed_weight.ALIKE),
}
"""On which side of a limit clean runs should stay, and the limit."""


def margins(seed: int) -> dict[str, float]:
    """Return what a clean run reaches, by the names of ``LIMITS``."""
    measured = measure(seed)
    return dict(zip(LIMITS, (*_of_imu(measured), *_of_residuals(measured), *_of_conventions(measured)), strict=True))


def _of_imu(measured):
    run = run_of(measured)
    imu = ImuSignal(run.t, run.omega, run.specific_force)
    by_gyro, by_accelerometer = imu_conventions._turns(imu)
    size = np.linalg.norm(run.specific_force, axis=1)
    return (
        lasting(run, run.force) / (measured.mass * GRAVITY), by_gyro / by_accelerometer,
        float(np.median(np.abs(size - np.median(size))) / np.median(size)), imu_conventions.without_lever(imu),
    )  # fmt: skip


def _of_residuals(measured):
    asked, bands = [], []

    def watched(*arguments):
        asked.append(arguments)
        return original(*arguments)

    original = judged_result.followed
    judged_result.followed = watched
    judged_result.resonance = lambda run, band: bands.append((run, band))
    try:
        result = identified(measured)
    finally:
        judged_result.followed, judged_result.resonance = original, resonance.resonance
    fits, excluded, base = asked[-1]
    judged = [cause.judged(base) for cause in causes.candidates(fits, excluded)]
    judged = [verdict for verdict in judged if verdict is not None]
    run, band = bands[-1]
    spectra = [welch(signal, run.rate, round(resonance.SEGMENT * run.rate)) for signal in (run.force, run.moment)]
    return (
        max(verdict.logarithm for verdict in judged), min(verdict.chance for verdict in judged),
        max(original(fits, excluded, base).unexplained),
        least_squares_difference(fits[0], base, MATTERS * result.standard_uncertainty).chance,
        max(resonance._peak(frequency, column, resonance.ABOVE * band)[1]
            for frequency, density in spectra for column in density.T),
    )  # fmt: skip


def _of_conventions(measured):
    wrench = WrenchSignal(measured.t_wrench, measured.force, measured.moment)
    sums = convention_sums(wrench, ImuSignal(measured.t_imu, measured.omega, measured.acceleration))
    given = axis_hypotheses.scales(sums, weight=True)
    scored = [float(axis_hypotheses.chi_square(hypothesis.applied(sums), given)) + hypothesis.cost
              for hypothesis in axis_hypotheses.hypotheses()]  # fmt: skip
    narrow = axis_hypotheses.scales(sums, weight=True, terms=MOMENT_TERMS)
    turn, chi_square, _ = axis_hypotheses.misalignment(sums, narrow)
    parts = [np.sqrt(variance / sums.changes(columns))
             for columns, variance in ((FORCE, given.force), (MOMENT, given.moment))]  # fmt: skip
    declared = DeclaredRig(mass=measured.mass, r_cg=measured.r_cg, sigma_r_cg=np.full(3, 1.5e-4))
    examination = examined_run.ExaminedRun(sums, declared, "", "")
    shift, chi_square_of_shift = examination.shift(sums)
    weight = removed_weight.apparent_mass(sums, measured.mass)
    force, specific = sums.mean(slice(0, 3)), sums.mean(slice(6, 9))
    return (
        min(scored[1:]) - scored[0], chi_square, float(np.degrees(np.linalg.norm(turn))), *parts,
        chi_square_of_shift, float(np.linalg.norm(shift)),
        abs(weight.mass / measured.mass - 1), float(force @ specific / np.linalg.norm(force) / np.linalg.norm(specific)),
    )  # fmt: skip


def main(arguments=None):
    from tests.helpers.trouble_study import begin

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    begin()
    rows = [margins(seed) for seed in range(parser.parse_args(arguments).runs)]
    print("statistic; limit; middle; nearest to the limit")
    for name, (sign, limit) in LIMITS.items():
        values = [row[name] for row in rows]
        nearest = max(values) if sign == "≤" else min(values)
        print(f"{name}; {sign} {limit:.3g}; {np.median(values):.3g}; {nearest:.3g}")


if __name__ == "__main__":
    main()

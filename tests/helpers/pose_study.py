"""The study of static poses that err: a knock, creep, hysteresis, gains; and sets in which nothing is wrong.

Poses and errors are those of tests/helpers/pose_lab.py, in plain NumPy: 3.7 kg, 0.2 N and 5 mN·m of noise an axis.

    python -m tests.helpers.pose_study
"""

import argparse
from collections.abc import Iterator

import numpy as np

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.centre_result import Centre
from identify.estimation.static_poses.pose_fit import EXACT, Attitudes
from tests.helpers.pose_lab import GRAVITY, KINDS, MASS, NOISE, R_CG, TRUTH, Kind, directions, signals
from uq.experiment.experiment import Experiment

SILENT = 2.0
"""Half-widths beyond which an answer without a warning is silently wrong."""


def obeyed(result: Centre, measured: tuple[np.ndarray, np.ndarray, np.ndarray], attitudes: Attitudes) -> Centre:
    """The centre without the poses that the warnings tell to leave out."""
    numbers = [int(text.rsplit(" ", 1)[1]) for text in result.warnings if "--without" in text]
    if not numbers:
        return result
    return centre(*measured, attitudes=attitudes, used=~np.isin(np.arange(len(measured[0])) + 1, numbers))


def off(result: Centre, half: np.ndarray) -> np.ndarray:
    """Errors of mass and centre of gravity in half-widths."""
    return np.abs(result.values - TRUTH)[:4] / half[:4]


def row(name: str, kind: Kind, repeats: int) -> list[str]:
    """What the warnings, the interval and the obeyed cure are worth."""
    rng = np.random.default_rng([37, list(KINDS).index(name)])
    named, others, silent, errors, cured = 0, 0, 0, [], []
    for _ in range(repeats):
        measured, attitudes = signals(kind, rng), Attitudes(kind.each) if kind.each else EXACT
        result = centre(*measured, attitudes=attitudes)
        right = kind.name is not None and any(kind.name in text for text in result.warnings)
        named += right
        others += bool(result.warnings) and not right
        for number, answer in enumerate((result, obeyed(result, measured, attitudes))):
            (errors, cured)[number].append(off(answer, np.ptp(answer.interval95, axis=1) / 2))
        silent += not result.warnings and errors[-1].max() > SILENT
    inside = [f"{100 * np.mean(np.array(each) <= 1):.1f}" for each in (errors, cured)]
    return [name, str(repeats), f"{named}", f"{others}", f"{silent}", f"{np.mean(errors, axis=0)[0]:.2f}", *inside]


UNDECLARED = {"force_gain": 0.0025, "moment_gain": 0.0025}
ALL = UNDECLARED | {
    "force_gain_by_axis": 0.0025, "moment_gain_by_axis": 0.0025, "cross_talk": 0.0015, "load_cell_axes": 0.005, "gravity": 0.015,
}  # fmt: skip


def gained(rng: np.random.Generator, sizes: dict[str, float], wrench: np.ndarray) -> np.ndarray:
    """What a load cell with errors of these sizes reads."""

    def drawn(name: str, count: int) -> np.ndarray:
        return sizes.get(name, 0.0) * rng.normal(size=count)

    gain = np.repeat([drawn(f"{name}_gain", 1)[0] for name in ("force", "moment")], 3)
    gain = gain + np.concatenate([drawn(f"{name}_gain_by_axis", 3) for name in ("force", "moment")])
    full = np.repeat([np.abs(part).max() for part in (wrench[:, :3], wrench[:, 3:])], 3)
    matrix = np.diag(gain) + drawn("cross_talk", 36).reshape(6, 6) * (1 - np.eye(6)) * np.outer(full, 1 / full)
    x, y, z = drawn("load_cell_axes", 3)
    matrix -= np.kron(np.eye(2), [[0, -z, y], [z, 0, -x], [-y, x, 0]])
    wrench = wrench * (1 + drawn("gravity", 1)[0] / GRAVITY)
    return wrench + wrench @ matrix.T


def undeclared_row(name: str, sizes: dict[str, float], told: dict[str, float], repeats: int) -> list[str]:
    """What interval and bound hold, and half of the mass's bound over half its interval."""
    from uq.runs.identification.undeclared import centre_with_undeclared

    rng, inside, ratio = np.random.default_rng(38), [], []
    experiment = Experiment.from_dict({"platform": {"gravity": f"{GRAVITY} m/s^2"}, "poses": {}, "undeclared": {
        key: False if key not in told else _text(key, told[key]) for key in ALL
    }})  # fmt: skip
    for _ in range(repeats):
        f = directions(rng, 24, None)
        weight = np.hstack([MASS * f, np.cross(R_CG, MASS * f)])
        read = gained(rng, sizes, weight) + TRUTH[4:] + rng.normal(size=(24, 6)) * NOISE
        result = centre(read[:, :3], read[:, 3:], f)
        result = centre_with_undeclared(result, experiment, wrench=read, specific_force=f, sensed=False)
        halves = [np.ptp(ends, axis=1) / 2 for ends in (result.interval95, result.conventional_bound)]
        inside.append([off(result, half) <= 1 for half in halves])
        ratio.append(halves[1][0] / halves[0][0])
    held = (100 * np.mean(inside, axis=(0, 2))).round(1)
    return [name, str(repeats), *map(str, held), f"{np.mean(ratio):.1f}"]


def _text(key: str, size: float) -> str:
    unit = {"load_cell_axes": "rad", "gravity": "m/s^2"}.get(key)
    return f"{size} {unit}" if unit else f"{100 * size} %"


def table(head: list[str], rows: Iterator[list[str]]) -> None:
    """Print a table in Markdown, line by line."""
    for line in (head, ["---"] * len(head)):
        print(f"| {' | '.join(line)} |")
    for cells in rows:
        print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=400)
    repeats = parser.parse_args().repeats
    head = ["set", "sets", "named", "other warnings", "silent", "mass off by", "held, %", "held after the cure, %"]
    table(head, (row(name, kind, repeats) for name, kind in KINDS.items()))
    print()
    cases = {"gains common to the axes": UNDECLARED, "all of [undeclared]": ALL}
    table(
        ["undeclared", "sets", "interval, %", "bound, %", "bound over interval, mass"],
        (undeclared_row(name, sizes, sizes, repeats) for name, sizes in cases.items()),
    )


if __name__ == "__main__":
    main()

"""The operating curve of every finding: how often clean runs have it, and how often an error of each size is named.

A cell is one run of tests/helpers/laboratory.py with one error, identified from its file and experiment as ``inertia
identify`` does; of contradictions with the conventions it is judged as ``inertia inspect`` does. An error of the rig has
the size that shifts some component of plain least squares by 1, 3, 10 and 30 standard uncertainties of a clean run;
where that is no measure, the sizes stand in :data:`CURVES`. Cells that the file has already are not done again.

    python -m tests.helpers.operating_curves --runs 6 --clean 100 --write   # 23 minutes of processor time
    python -m tests.helpers.operating_curves --write                        # 20 runs a size, 200 clean ones
    python -m tests.helpers.operating_curves --texts                        # seconds, after a change of a finding

``--write`` puts the figures into docs/explanation/findings.csv, and into table and pages of findings in
docs/explanation/troubles.md and docs/explanation/findings, whose texts are those of the findings' files. ``--texts``
renews these alone.
"""

import argparse
import csv
import json
import re
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from identify.display.reporting import place_in_docs
from identify.display.rounding import significant
from identify.errors.error_model import CauseWords
from identify.errors.registry import ERRORS
from identify.judge.finding_pages import FindingPage, all_findings
from tests.helpers.laboratory import FINE, Measured, measure
from tests.helpers.laboratory_mechanics import GRAVITY, base_angles, base_motion
from tests.helpers.trouble_study import CLEAN, FIRST, begin, rows_in, said
from tests.helpers.troubles import TROUBLES, size_for

DOCS = Path(__file__).parents[2] / "docs" / "explanation"
FIGURES, PAGE, PAGES = DOCS / "findings.csv", DOCS / "troubles.md", DOCS / "findings"
BEGIN, END = "<!-- written by python -m tests.helpers.operating_curves --write -->\n", "<!-- end of the findings -->\n"
SHIFTS = (1.0, 3.0, 10.0, 30.0)
"""Shifts of plain least squares that an error of the rig makes [standard uncertainties]."""
SEVERAL = 4
"""Runs of one body that are identified together, where their scatter is judged."""
CONVENTIONS = "conventions"
"""The judge of signs, axes, units and zeros, in place of a method."""


@dataclass(frozen=True)
class Curve:
    """An error of the laboratory that a finding is to name."""

    trouble: str = ""
    """One of tests/helpers/troubles.py, or the text that the table has for the error."""
    sizes: tuple[float, ...] = ()
    """Sizes that are tried; none: those that shift plain least squares by ``SHIFTS``."""
    method: str = "source"
    unit: str = ""
    spoil: Callable[[Measured, float], Measured] | None = None
    """What was done to a clean run's samples; None: the trouble is in the laboratory."""
    label: str = ""
    """Label of the finding, where two curves are of one."""


def _wrench(measured: Measured, force, moment) -> Measured:
    return replace(measured, force=measured.force @ np.asarray(force), moment=measured.moment @ np.asarray(moment))


def _imu(measured: Measured, omega, acceleration) -> Measured:
    return replace(
        measured,
        omega=measured.omega @ np.asarray(omega),
        acceleration=measured.acceleration @ np.asarray(acceleration),
    )


def _turned(measured: Measured, degrees: float) -> Measured:
    matrix = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.64, 0.48])).as_matrix()
    return _imu(measured, matrix, matrix)


def _lighter(measured: Measured, share: float) -> Measured:
    force = share * measured.force.mean(axis=0)
    return replace(measured, force=measured.force - force, moment=measured.moment - np.cross(measured.r_cg, force))


def _elsewhere(measured: Measured, distance: float) -> Measured:
    """The moment about another point, across the weight."""
    axis = np.cross(measured.force.mean(axis=0), [0.3, 0.8, 0.5])
    return replace(measured, moment=measured.moment - np.cross(distance * axis / np.linalg.norm(axis), measured.force))


def _force_late(measured: Measured, delay: float) -> Measured:
    late = [np.interp(measured.t_wrench - delay, measured.t_wrench, force) for force in measured.force.T]
    return replace(measured, force=np.stack(late, axis=1))


def _low_passed(measured: Measured, corner: float) -> Measured:
    """The wrench behind a low-pass of first order [Hz], exact for lines from sample to sample; its zero passes whole."""
    step = measured.t_wrench[1] - measured.t_wrench[0]
    system = (1.0, [1 / (2 * np.pi * corner), 1.0])
    (taps,), poles, _ = scipy.signal.cont2discrete(system, step, method="foh")
    force, moment = (
        scipy.signal.lfilter(taps, poles, x - x[0], axis=0) + x[0] for x in (measured.force, measured.moment)
    )
    return replace(measured, force=force, moment=moment)


def _without_gravity(measured: Measured, share: float) -> Measured:
    """The accelerometer's readings without so much of gravity."""
    up = base_motion(measured.setup).up[:: FINE // measured.setup.rate]
    return replace(measured, acceleration=measured.acceleration - share * GRAVITY * up)


def _accelerometer_late(measured: Measured, delay: float) -> Measured:
    late = [np.interp(measured.t_imu - delay, measured.t_imu, values) for values in measured.acceleration.T]
    return replace(measured, acceleration=np.stack(late, axis=1))


def _euler_rates(measured: Measured, swing: float) -> Measured:
    """The rates of roll, pitch and yaw for the angular velocity, of a motion of so many times the usual angles."""
    setup, every = replace(measured.setup, swing=(swing,) * 3), FINE // measured.setup.rate
    run = measure(measured.seed, setup)
    t = np.arange(round(setup.seconds * FINE) + 1) / FINE
    rates = base_angles(t, setup.seconds, swing=setup.swing)[1][::every, ::-1]
    return replace(run, omega=run.omega + rates - base_motion(setup).omega[::every])


EYE, SWAP, CYCLE = np.eye(3), np.eye(3)[[1, 0, 2]], np.eye(3)[[1, 2, 0]]
CURVES = {
    "delay": Curve("delay"),
    "rotation": Curve("IMU axes"),
    "centre of gravity": Curve("r_CG"),
    "mass": Curve("mass", (0.03, 0.1, 0.3, 1.0)),
    "mass, by a gain": Curve(
        "gain of force and moment alike", (0.01, 0.03, 0.1, 0.3), "source", "",
        lambda run, size: _wrench(run, (1 + size) * EYE, (1 + size) * EYE), "mass",
    ),
    "still missed": Curve("still missed", (0.01, 0.03, 0.1, 0.3)),
    "gyro scale": Curve("gyro scale"),
    "gyro bias": Curve("gyro drift"),
    "gyro axes": Curve("gyro axes"),
    "gyro g-sensitivity": Curve("gyro g-sensitivity"),
    "gain": Curve("gain of force"),
    "cross-talk": Curve("cross-talk"),
    "drift": Curve("load cell drift"),
    "jump": Curve("jump"),
    "slip": Curve("slip"),
    "gain drift": Curve("gain drift"),
    "cable": Curve("cable"),
    "air": Curve("air"),
    "flexible mounting": Curve("flexible mounting"),
    "accelerometer place": Curve("accelerometer place", (1e-3, 3e-3, 0.01, 0.03), "joint"),
    "accelerometer scale": Curve("accelerometer scale", (1e-3, 3e-3, 0.01, 0.03), "joint"),
    "accelerometer delay": Curve(
        "accelerometer late", (1e-4, 1e-3, 0.01, 0.03), "joint", "s", _accelerometer_late
    ),
    "clock": Curve("clock", (1e-5, 3e-5, 1e-4, 3e-4), "joint"),
    "filter": Curve("force alone late", (1e-4, 3e-4, 1e-3, 3e-3), "source", "s", _force_late),
    "filter, by conventions": Curve(
        "low-pass of the wrench", (20.0, 10.0, 5.0, 3.0), CONVENTIONS, "Hz", _low_passed, "filter"
    ),
    "linear acceleration": Curve("acceleration without gravity", (1.0,), CONVENTIONS, "", _without_gravity),
    "nonlinearity": Curve("nonlinearity"),
    "resonance": Curve("hum", (0.1, 0.3, 1.0, 3.0)),
    "saturation": Curve("clipping", (0.001, 0.01, 0.1, 0.3)),
    "unexplained": Curve("sloshing", (0.1, 0.3, 0.6, 0.9)),
    "repeatability": Curve("gyro scale"),
    "unit": Curve("moment in N·mm", (1e3,), CONVENTIONS, "", lambda run, size: _wrench(run, EYE, size * EYE)),
    "sign": Curve("wrench reversed", (1.0,), CONVENTIONS, "", lambda run, size: _wrench(run, -EYE, -EYE)),
    "axes": Curve("IMU's axes in another order", (1.0,), CONVENTIONS, "", lambda run, size: _imu(run, CYCLE, CYCLE)),
    "euler rates": Curve(
        "gyro channels that hold the rates of Euler angles", (0.5, 1.0, 2.0), CONVENTIONS, "times 0.3 rad", _euler_rates
    ),
    "mirror": Curve("IMU left-handed", (1.0,), CONVENTIONS, "", lambda run, size: _imu(run, SWAP, SWAP)),
    "turned": Curve("IMU turned", (0.3, 1.0, 3.0, 30.0), CONVENTIONS, "deg", _turned),
    "weight": Curve("missing from mean force and moment", (0.3, 0.5, 0.7, 1.0), CONVENTIONS, "of the weight", _lighter),
    "mass, by conventions": Curve(
        "mass declared", (0.1, 0.2, 0.4, 0.8), CONVENTIONS, "too large, in parts",
        lambda run, size: replace(run, mass=run.mass * (1 + size)), "mass",
    ),
    "point": Curve("moment taken elsewhere", (1e-3, 3e-3, 0.01, 0.03), CONVENTIONS, "m", _elsewhere),
}  # fmt: skip
"""By the finding's label. No error of this laboratory changes the tensor, or shows in ``least squares`` alone."""


class CurveCell(NamedTuple):
    """One clean or spoiled run, judged once."""

    finding: str
    level: int
    """Place of the size among those of the curve."""
    method: str
    seed: int


def cells(runs: int, clean: int) -> list[CurveCell]:
    """Return the clean cells, by every judge, and those of each curve."""
    several = [CurveCell(CLEAN, 0, "repeatability", seed) for seed in range(clean // 2)]
    judges = dict.fromkeys(curve.method for curve in CURVES.values())
    alone = [CurveCell(CLEAN, 0, method, seed) for method in judges for seed in range(clean)]
    spoiled = [
        CurveCell(label, level, curve.method, FIRST + k)
        for label, curve in CURVES.items() for level in range(len(curve.sizes or SHIFTS)) for k in range(runs)
    ]  # fmt: skip
    return [*alone, *several, *spoiled]


def row_of(cell: CurveCell, u) -> dict:
    """Do one cell: its size, what was named, and what else a clean run tells.

    Args:
        cell: which run.
        u: standard uncertainty of a clean run, (6,) [kg·m²].
    """
    began, row, curve = time.process_time(), cell._asdict(), CURVES.get(cell.finding, Curve(sizes=(0.0,)))
    if cell.finding == CLEAN:
        measured = [measure(cell.seed)]
        if cell.method == "repeatability":
            measured = [measure(SEVERAL * cell.seed + k) for k in range(SEVERAL)]
    else:
        row["size"], measured = _spoiled(cell, curve, u)
    return row | _named(cell, measured) | {"cpu_seconds": round(time.process_time() - began, 2)}


def _spoiled(cell: CurveCell, curve: Curve, u) -> tuple[float, list[Measured]]:
    """Size of the error, and the runs that have it."""
    if curve.spoil:
        return curve.sizes[cell.level], [curve.spoil(measure(cell.seed), curve.sizes[cell.level])]
    trouble, still = TROUBLES[curve.trouble], bool(TROUBLES[curve.trouble].still)
    sizes = curve.sizes
    size = sizes[cell.level] if sizes else size_for(trouble, SHIFTS[cell.level], np.asarray(u), cell.seed)
    seeds = [SEVERAL * cell.seed + k for k in range(SEVERAL)] if cell.finding == "repeatability" else [cell.seed]
    return size, [measure(seed, still=still, **trouble.options(size, seed)) for seed in seeds]


def _named(cell: CurveCell, measured: list[Measured]) -> dict:
    """What the judge names of some runs."""
    from identify.exceptions import RunError
    from tests.helpers.laboratory_files import document, identified_files, write
    from uq.experiment.experiment import Experiment
    from uq.runs.inspection.experiment_findings import experiment_findings
    from uq.runs.recorded.load_run import load_run

    with tempfile.TemporaryDirectory() as folder:
        if cell.method == CONVENTIONS:
            experiment = Experiment.from_dict(document(measured[0]))
            run = load_run(write(Path(folder) / "run.mcap", measured[0]), experiment.recording)
            return {"causes": [finding.kind for finding in experiment_findings(run, experiment)]}
        try:
            method = "source" if cell.method == "repeatability" else cell.method
            result = said(identified_files(measured, Path(folder), method), measured[0].truth)
        except RunError as refused:
            return {"causes": ["refused"], "warnings": [str(refused)]}
    return {name: result[name] for name in ("causes", "warnings", "u")}


def run_cells(wanted: list[CurveCell], path: Path) -> list[dict]:
    """Do the cells that are not in the file yet, clean ones first, and return all of its rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = rows_in(path)
    done = {CurveCell(*(row[name] for name in CurveCell._fields)) for row in rows}
    for cell in wanted:
        if cell not in done:
            clean = [row["u"] for row in rows if row["finding"] == CLEAN and row["method"] == "source"]
            rows.append(row_of(cell, np.mean(clean, axis=0) if clean else None))
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    return rows


HEAD = ("finding", "clean runs", "false alarms", "error", "sizes", "runs a size", "named [%]", "warned [%]")


def table(rows: list[dict]) -> list[tuple[str, ...]]:
    """A line for each finding: false alarms, and how often each size of its error is named, and warned of at all."""
    lines = []
    for label, curve in CURVES.items():
        judge = "repeatability" if label == "repeatability" else curve.method
        clean = [row for row in rows if row["finding"] == CLEAN and row["method"] == judge]
        by_level = [[row for row in rows if (row["finding"], row["level"]) == (label, level)]
                    for level in range(len(curve.sizes or SHIFTS))]  # fmt: skip
        if not all(by_level):
            continue
        sizes = "/".join(significant(float(np.median([row["size"] for row in some])), 2) for some in by_level)
        unit = curve.unit or ("" if curve.spoil else TROUBLES[curve.trouble].unit.removeprefix("1").strip())
        name = curve.label or label
        lines.append((
            label, f"{len(clean)}", f"{sum(_names(row, name) for row in clean)}", curve.trouble,
            f"{sizes} {unit}".strip() if len(by_level) > 1 else "", f"{len(by_level[0])}",
            _percent(by_level, lambda row, name=name: _names(row, name)),
            _percent(by_level, lambda row: bool(row["causes"] or row.get("warnings"))),
        ))  # fmt: skip
    return lines


def _names(row: dict, label: str) -> bool:
    """Whether a row names a finding, or says that it is as probable as the one that it names."""
    rivals = [text.split("; as probable: ")[1].split(";")[0] for text in row.get("warnings", []) if "; as prob" in text]
    return label in row["causes"] or label in ", ".join(rivals).split(", ")


def _percent(by_level, happened: Callable[[dict], bool]) -> str:
    return "/".join(f"{100 * np.mean([happened(row) for row in some]):.0f}" for some in by_level)


def page_with_findings() -> str:
    """The page of troubles with its table of findings as they and their figures are now."""
    page = PAGE.read_text("utf-8")
    head, rest = page.split(BEGIN)
    figures, pages = _figures(), {finding.label: finding for finding in all_findings()}
    labels = dict.fromkeys([*(cause.label for cause in causes()), *pages])
    rows = [_row(label, pages.get(label), figures.get(label)) for label in labels]
    titles = (
        "| finding | what it looks like | cure | false alarms | error, sizes | named, % |\n|---|---|---|---|---|---|\n"
    )
    return head + BEGIN + titles + "".join(rows) + END + rest.split(END)[1]


def causes() -> list[CauseWords]:
    """Return the words of all errors that the judge may name."""
    return [error.words for error in ERRORS.values() if error.label]


def _figures() -> dict[str, dict[str, str]]:
    with FIGURES.open(encoding="utf-8", newline="") as file:
        return {row["finding"]: row for row in csv.DictReader(file)}


def _row(label: str, page: FindingPage | None, figures: dict[str, str] | None) -> str:
    """A line of the table, with the anchor to which messages lead."""
    same = [cause for cause in causes() if cause.label == label]
    looks, cures = (dict.fromkeys(map(words, same)) for words in (_looks, _cure))
    if page:
        looks, cures = ({**texts, _clause(text): None} for texts, text in ((looks, page.summary), (cures, page.cure)))
    cells = [_alarms(figures), _error(figures), figures["named [%]"]] if figures else ["–", "–", "–"]
    anchor = place_in_docs(label).partition("#")[2]
    name = f"[`{label}`](findings/{anchor}.md)" if page else f"`{label}`"
    return f'| <a id="{anchor}"></a>{name} | {" | ".join(["; or ".join(looks), "; or ".join(cures), *cells])} |\n'


def _clause(sentence: str) -> str:
    return (sentence[0].lower() + sentence[1:]).rstrip(".")


def _alarms(figures: dict[str, str]) -> str:
    return f"{figures['false alarms']} of {figures['clean runs']}"


def _error(figures: dict[str, str]) -> str:
    return ": ".join(filter(None, (figures["error"], figures["sizes"])))


def _looks(cause: CauseWords) -> str:
    if cause.pattern == "{}":
        text = cause.write_size(np.full(2, 3e-5), np.full(2, 1e-6))
        return "as if " + re.sub(r"\(?\d[^a-zA-Z]*", "… ", text)
    return "as if " + re.sub(r"\{[^}]*\}", "…", cause.pattern)


def _cure(cause: CauseWords) -> str:
    return re.sub(r"\{[^}]*\}", "…", cause.cure)


def pages() -> dict[Path, str]:
    """A page for each finding: the docstring of its file, what its variants print, and its operating curves."""
    return {PAGES / f"{finding.label.replace(' ', '-')}.md": _page(finding) for finding in all_findings()}


def _page(finding: FindingPage) -> str:
    """The page of a finding."""
    printed = "".join(f"\n```text\n{line}\n```\n" for line in finding.printed)
    same = {label: curve for label, curve in CURVES.items() if finding.label in (label, curve.label)}
    # an error of the rig of the same label is another matter: its row is in the table
    shown = [label for label, curve in same.items() if (curve.method == CONVENTIONS) != finding.in_results]
    curves = [row for label, row in _figures().items() if label in shown]
    how_often = "No error of the simulated laboratory shows in this finding." if not curves else (
        "| error, sizes | false alarms in clean runs | named, % |\n|---|---|---|"
        + "".join(f"\n| {_error(row)} | {_alarms(row)} | {row['named [%]']} |" for row in curves)
    )  # fmt: skip
    return (
        f"# `{finding.label}`\n\n*What does this finding mean, and what do I do?*\n\n{finding.text}\n\n## What is printed\n"
        f"{printed}\n## How often it is named\n\n{how_often}\n\nOf runs of a simulated laboratory: [all figures](../findings.csv). "
        "All findings: [when the rig errs](../troubles.md#"
        "what-a-result-can-name).\n"
    )


def write_texts() -> None:
    """Write the table and the pages of findings as their files and figures are now."""
    PAGE.write_text(page_with_findings(), "utf-8")
    PAGES.mkdir(exist_ok=True)
    for path in set(PAGES.glob("*.md")) - set(pages()):
        path.unlink()
    for path, text in pages().items():
        path.write_text(text, "utf-8")


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="of each size of an error")
    parser.add_argument("--clean", type=int, default=200, help="clean runs by each judge")
    parser.add_argument("--out", default="out/operating-curves.jsonl")
    parser.add_argument("--write", action="store_true", help="renew findings.csv, and table and pages of findings")
    parser.add_argument("--texts", action="store_true", help="renew the texts of table and pages, and stop")
    asked = parser.parse_args(arguments)
    if asked.texts:
        write_texts()
        return
    begin()
    rows = run_cells(cells(asked.runs, asked.clean), Path(asked.out))
    lines = [HEAD, *table(rows)]
    print(*("; ".join(line) for line in lines), sep="\n")
    print(f"{sum(row['cpu_seconds'] for row in rows):.0f} s of processor time")
    if asked.write:
        with FIGURES.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(lines)
        write_texts()


if __name__ == "__main__":
    main()

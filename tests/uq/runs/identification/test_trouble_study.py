"""The study of troubles (``make study``): no answer silently wrong; and that its tables count as they should."""

import json
import os

import numpy as np
import pytest

from tests.helpers import trouble_study as study
from tests.helpers.troubles import TROUBLES

RUNS, CLEAN_RUNS = 20, 200


def made(trouble=study.CLEAN, *, off=0.5, level="large", method="source", seed=0, **more):
    """A row as a cell leaves it."""
    cell = study.Cell(trouble, "" if trouble == study.CLEAN else level, method, seed)
    offs = [0.1] * 5 + [off]
    covered = [value <= 1 for value in offs]
    row = {"off": offs, "off_with_price": [value / 2 for value in offs], "covered": covered, "u": [1e-3] * 6}
    return cell._asdict() | row | {"warnings": [], "causes": [], "size": 1.0, **more}


def test_what_is_off_and_not_said_is_silently_wrong():
    assert study.silently_wrong(made("cable", off=2.1))
    assert study.silently_wrong(made("cable", off=float("nan")))
    assert not study.silently_wrong(made("cable", off=1.9))
    assert not study.silently_wrong(made("cable", off=40.0, warnings=["a cable"]))
    refused = {"refused": "no solution"} | study.Cell("cable", "small", "joint", 1)._asdict()
    assert not study.silently_wrong(refused)
    assert study.silently_wrong({"crashed": "ValueError()"} | refused | {"off": [0]})
    assert study.named_right(made("delay", causes=["delay", "drift"], warnings=["late"]))
    assert study.named_right(made("delay", causes=["drift", "delay"], warnings=["late"])) is False
    assert study.named_right(made("delay")) is None  # an unknown took it up
    assert study.beyond_its_price(made("cable", off=2.1))
    assert not study.beyond_its_price(made("cable", off=2.1, off_with_price=[0.9]))
    assert study.named_right(made("vibration")) is None


def test_tables_count_runs_components_and_causes():
    clean = [made(seed=k, off=1.5 if k else 0.5, warnings=["w"] * (k == 2)) for k in range(4)]
    assert "| source | 4 | 21 of 24 | I33 1 of 4 | 1.1 | 1 | – 4 |" in study.clean_table(clean)
    rows = [made("delay", off=3.0, causes=["delay"], warnings=["late"]), made("delay", off=5.0, seed=1)]
    line = study.summary([*clean, *rows]).splitlines()[-2]
    assert line == "| delay | 1 s | – | – | – |  | 83/–/– | 3.3/–/– | 50/–/– | 50/–/– |"
    small = [made("delay", off=5.0, level="small"), made("delay", off=0.5, level="small", seed=1)]
    assert study.summary(small).splitlines()[-2] == "| delay | 1 s | 92/–/– | 2.8/–/– | 0/–/– | 50/–/– | – | – | – |  |"
    line = study.table([*clean, *rows]).splitlines()[-1]
    assert line == "| delay | large: 1 s | source | 4, 5 | 10 of 12 | 3.3 | 1 of 2 | delay 1, – 1 | 1 of 2 | 1 | 1 |"


def test_cells_in_the_file_are_not_done_again(tmp_path, monkeypatch):
    """One of two cells is there already; u of the sizes is that of clean runs, of which four are added."""

    class Here:
        """The pool, in this process."""

        def __init__(self, *_):
            self.done = []

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def submit(self, function, cell, u):
            return done.append((cell, u)) or made(cell.trouble, seed=cell.seed, u=[2e-3] * 6)

    done, path = [], tmp_path / "rows.jsonl"
    monkeypatch.setattr(study, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(
        study, "as_completed", lambda rows: [type("Done", (), {"result": lambda self, r=r: r})() for r in rows]
    )
    cells = study.trouble_cells(["cable"], 2, ["source"], ["large"])
    path.write_text(json.dumps(made("cable", seed=study.FIRST)) + "\n")
    rows = study.run_cells(cells, path)
    assert [cell.trouble for cell, _ in done] == [study.CLEAN] * 4 + ["cable"]
    assert done[-1] == (cells[1], [2e-3] * 6)
    assert len(rows) == 6
    done.clear()
    assert study.run_cells(cells, path) == rows
    assert not done


def test_declared_cells_are_of_troubles_that_have_a_source():
    cells = study.trouble_cells(["gyro scale", "jitter", "still missed"], 1, ["joint"], ["small"], declared=True)
    assert [cell.trouble for cell in cells] == ["gyro scale", "still missed"]
    assert study.trouble_cells(["still missed"], 1, ["joint"])[0].still


@pytest.mark.study
def test_no_answer_is_silently_wrong(tmp_path):
    """Every trouble at both sizes, 20 runs each and 200 clean ones, by all methods, some hours on two cores.

    ``INERTIA_STUDY`` names a file that keeps what is done, so that the study can be stopped and gone on with.
    """
    path = os.environ.get("INERTIA_STUDY", tmp_path / "troubles.jsonl")
    cells = study.clean_cells(CLEAN_RUNS) + study.trouble_cells(TROUBLES, RUNS)
    rows = study.run_cells(cells, path)
    print(study.clean_table(rows), study.table(rows), sep="\n\n")
    assert {study.Cell.of(row) for row in rows} >= set(cells)
    assert not [row["crashed"] for row in rows if "crashed" in row]
    clean = [row for row in rows if row["trouble"] == study.CLEAN and not row["still"]]
    assert sum(map(study.warned, clean)) <= 0.05 * len(clean)
    for method in study.METHODS:
        covered = np.array([row["covered"] for row in clean if row["method"] == method])
        assert 0.93 <= covered.mean() <= 0.98
        assert covered.mean(axis=0).min() >= 0.9
    # what leaves no trace in the residuals is told beforehand, by its price
    assert not any(map(study.beyond_its_price, rows))
    large = [row for row in rows if row["level"] == "large"]
    assert {row["trouble"] for row in large if study.silently_wrong(row)} <= {"gain of moment"}
    named = [right for row in large if (right := study.named_right(row)) is not None]
    assert np.mean(named) >= 0.8

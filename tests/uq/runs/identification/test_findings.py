"""The operating curves of findings, and their table in the documentation."""

from identify.judge.cure import Cure
from identify.judge.finding_pages import all_findings
from tests.helpers import operating_curves
from tests.helpers.trouble_study import CLEAN
from uq.experiment.pose_table import Poses
from uq.experiment.recording_table import RecordingTable


def test_the_table_of_findings_has_their_texts_and_figures():
    """Otherwise: ``python -m tests.helpers.operating_curves --texts``."""
    assert operating_curves.PAGE.read_text("utf-8") == operating_curves.page_with_findings()


def test_the_pages_of_findings_are_their_docstrings():
    """Otherwise: ``python -m tests.helpers.operating_curves --texts``."""
    written = {path: path.read_text("utf-8") for path in operating_curves.PAGES.glob("*.md")}
    assert written == operating_curves.pages()


def test_every_finding_has_a_curve_or_no_error_of_the_laboratory():
    labels = {words.label for words in (*operating_curves.causes(), *all_findings())} - set(operating_curves.CURVES)
    assert labels == {"tensor", "least squares", "frame", "gravity", "attitude"}


def test_every_key_that_a_cure_sets_is_one_of_the_experiment_file():
    keys = {"recording": RecordingTable.__struct_fields__, "poses": Poses.__struct_fields__}
    cures = [example.cure for page in all_findings() for example in page.examples if isinstance(example.cure, Cure)]
    parts = [part for cure in cures for part in cure.parts]
    assert {part.table for part in parts} == set(keys)
    assert [key for part in parts for key in part.values if key not in keys[part.table]] == []


def test_the_curve_counts_a_rival_as_named():
    row = {"causes": ["gain"], "warnings": ["r: … (gain); as probable: clock, delay; calibrate it"]}
    assert [operating_curves._names(row, label) for label in ("gain", "delay", "calibrate it")] == [True, True, False]


def test_cells_that_are_done_are_not_done_again(tmp_path, monkeypatch):
    """The clean run comes first: the sizes are in its standard uncertainties."""
    seen = []

    def done(cell, u):
        seen.append(u if u is None else list(u))
        return cell._asdict() | {"causes": [], "warnings": [], "u": [2.0] * 6, "size": 1.0, "cpu_seconds": 0.0}

    monkeypatch.setattr(operating_curves, "row_of", done)
    clean, spoiled = (operating_curves.CurveCell(name, 0, "source", 1) for name in (CLEAN, "delay"))
    for _ in range(2):
        rows = operating_curves.run_cells([clean, spoiled], tmp_path / "rows.jsonl")
    assert seen == [None, [2.0] * 6]
    assert [row["finding"] for row in rows] == [CLEAN, "delay"]

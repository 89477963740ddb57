"""The table ``[undeclared]``: figures with their units, false for none, and a line for every mistake."""

import re
from pathlib import Path

import pytest

from tests.helpers.laboratory_files import quantities
from uq.experiment.experiment import Experiment
from uq.experiment.undeclared_table import NONE, UndeclaredTable
from uq.files.mistakes import ExperimentError

DOCS = Path(__file__).parents[3] / "docs"


def loaded(**keys):
    body = {"r_cg_from_q": quantities([0, 0, 0.05], "m")}
    return Experiment.from_dict({"body": body, "undeclared": keys}).undeclared


def test_figures_arrive_in_si_and_false_is_none():
    table = loaded(force_gain="1 %", gyro_axes="0.5 deg", mounting_frequency="80 Hz", delay=False)
    assert table.force_gain == pytest.approx(0.01)
    assert table.gyro_axes == pytest.approx(0.0087266, rel=1e-4)
    assert table.mounting_frequency == pytest.approx(80)
    assert table.delay is None
    assert table.moment_gain == UndeclaredTable().moment_gain


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"force_gain": 0.5}, 'undeclared.force_gain is 0.5: write a value with its unit, such as "1 %"'),
        ({"delay": "-1 ms"}, "undeclared.delay is '-1 ms': write a value above zero"),
        ({"delay": True}, 'undeclared.delay is true: write a figure such as "1 s", or false'),
        ({"gyro_axes": "5 Hz"}, "undeclared.gyro_axes is '5 Hz': write a unit of the same dimension as rad"),
        ({"gain": "1 %"}, "unknown key undeclared.gain"),
    ],
)
def test_a_mistake_is_one_line(keys, line):
    with pytest.raises(ExperimentError, match=f"^{re.escape(line)}") as caught:
        loaded(**keys)
    assert "\n" not in str(caught.value)


def test_none_is_for_experiments_that_declare_everything():
    body = {"r_cg_from_q": quantities([0, 0, 0.05], "m")}
    assert Experiment.from_dict({"undeclared": "none", "body": body}).undeclared == NONE
    assert set(NONE.to_dict().values()) == {None}
    with pytest.raises(ExperimentError, match=r"^undeclared is 'all': choose one of none$"):
        Experiment.from_dict({"undeclared": "all", "body": body})


def test_the_old_name_is_read():
    body = {"r_cg_from_q": quantities([0, 0, 0.05], "m")}
    old = Experiment.from_dict({"not_included": {"delay": False}, "body": body})
    assert old.undeclared.delay is None
    with pytest.raises(ExperimentError, match=r"^unknown key not_included"):
        Experiment.from_dict({"not_included": {}, "undeclared": {}, "body": body})


def test_the_documentation_has_the_figures():
    """The rows ``| `key` | "figure" |`` of docs/how-to/identify.md, read as an experiment file has them."""
    rows = dict(
        re.findall(r'^\| `(\w+)` \| `"([^"]+)"` \|', (DOCS / "how-to" / "identify.md").read_text("utf-8"), flags=re.M)
    )
    stated = {key: figure for key, figure in UndeclaredTable().to_dict().items() if figure is not None}
    assert set(stated) <= set(rows)
    read = loaded(**{key: rows[key] for key in stated}).to_dict()
    assert {key: read[key] for key in stated} == pytest.approx(stated)

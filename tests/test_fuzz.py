"""The short form of ``make fuzz``: the same mutated files in every run."""

import pytest

from tests.helpers import fuzz

KINDS = (
    "experiment", "declared", "body", "rig", "map", "table", "poses", "centre", "mcap", "zst", "cut", "run", "bag", "urdf",
    "checkpoint", "campaign", "sqlite",
)  # fmt: skip


RESUMED = {"checkpoint", "campaign"}
"""Of a campaign that is run for them; files of it that are cut, exchanged or empty: trials/test_checkpoint.py."""


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return fuzz.kinds(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("name", "count"),
    [
        *((name, 3) for name in KINDS if name not in RESUMED),
        *(pytest.param(name, 12, marks=pytest.mark.slow) for name in KINDS),
    ],
)
def test_a_mutated_file_gives_a_result_or_one_line(name, count, kinds, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(next(path for path in tmp_path_factory.getbasetemp().glob("fuzz*")))
    assert set(kinds) == set(KINDS)
    if count > 3:
        assert not fuzz.refused_originals(kinds[name])
    else:
        assert fuzz.outcome(kinds[name], kinds[name].originals[0]) == fuzz.Outcome("", True)
    assert not fuzz.fuzz(kinds[name], count)[1]

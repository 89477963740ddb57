"""The short form of ``make fuzz``: the same mutated files in every run."""

import pytest

from tests.helpers import fuzz

KINDS = (
    "experiment", "declared", "body", "rig", "map", "table", "poses", "centre", "mcap", "zst", "cut", "run", "bag", "urdf",
    "checkpoint", "campaign", "sqlite",
)  # fmt: skip


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    return fuzz.kinds(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("count", [3, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", KINDS)
def test_a_mutated_file_gives_a_result_or_one_line(name, count, kinds, tmp_path_factory, monkeypatch):
    monkeypatch.chdir(next(path for path in tmp_path_factory.getbasetemp().glob("fuzz*")))
    assert set(kinds) == set(KINDS)
    assert not fuzz.refused_originals(kinds[name])
    assert not fuzz.fuzz(kinds[name], count)[1]

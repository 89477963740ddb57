"""The message on sources that the law does not take, beside a result file that is none."""

from pathlib import Path

import pytest

from uq.analysis.propagation.uncovered_sources import BeyondLawError
from uq.cli.terminal.sources import shares_named
from uq.experiment.experiment import Experiment


@pytest.mark.parametrize("folder", [None, Path()], ids=["none", "here"])
def test_a_result_file_that_is_none_adds_no_shares(tmp_path, monkeypatch, folder):
    monkeypatch.chdir(tmp_path)
    Path("result.json").write_text("[" * 100_000)
    with pytest.raises(BeyondLawError), shares_named(Experiment.load("barreto2016"), folder):
        raise BeyondLawError({"r_cg": "it is not small"})

"""The runs of one body in several processes: the same bits, the same refusals, one bar."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identify.signals.run import RunError
from tests.helpers.recordings import Signals, declare, write
from uq.monte_carlo.campaign.simulation import simulate
from uq.processes import process_pool
from uq.runs.identification.identify_files import identify_files


@pytest.fixture(scope="module")
def runs(tmp_path_factory, short):
    """Three runs of one motion, each with noise of its own."""
    folder, signals = tmp_path_factory.mktemp("many"), Signals.of(simulate(short, "T1"))
    rng = np.random.default_rng(5)
    noisy = [
        replace(signals, moment=signals.moment + 0.02 * rng.standard_normal(signals.moment.shape)) for _ in range(3)
    ]
    return [write(folder / f"run{k}.mcap", run) for k, run in enumerate(noisy)]


@pytest.fixture(autouse=True)
def few_runs_pay(monkeypatch):
    monkeypatch.setattr(process_pool, "FEWEST", 1)


def content(result) -> str:
    return json.dumps({key: value for key, value in result.to_dict().items() if key != "provenance"}, sort_keys=True)


@pytest.mark.parametrize(
    "method", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("source", "joint")), "gls"]
)
def test_the_numbers_are_the_same_whatever_the_number_of_processes(runs, short, method, monkeypatch):
    steps = []
    one = identify_files(runs, declare(short), method=method, processes=1, progress=lambda *step: steps.append(step))
    assert not steps
    for processes, blas in ((2, "1"), (3, "4")):  # helped by this one, or not
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", blas)
        several = identify_files(
            runs, declare(short), method=method, processes=processes, progress=lambda *step: steps.append(step)
        )
        assert content(several) == content(one)
    assert {name for name, *_ in steps} == {"runs"}
    assert all(done < asked == 3 for _, done, asked in steps)


def test_a_run_that_is_refused_is_refused_in_the_same_words(runs, short, tmp_path):
    (tmp_path / "cut.mcap").write_bytes(runs[1].read_bytes()[:1000])
    for broken in ([runs[0], tmp_path / "cut.mcap", tmp_path / "none.mcap", runs[2]], [*runs, tmp_path / "none.mcap"]):
        errors = []
        for processes in (1, 2):
            with pytest.raises((RunError, ValueError, OSError)) as refused:
                identify_files(broken, declare(short), processes=processes)
            errors.append((type(refused.value), str(refused.value)))
        assert errors[0] == errors[1]

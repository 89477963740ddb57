"""The named troubles: each does what its size says, and those with sources declare them."""

import numpy as np
import pytest

from tests.helpers import judge_margins, laboratory_files
from tests.helpers.laboratory import RATE, Setup, measure
from tests.helpers.troubles import TROUBLES, shift, size_for
from uq.experiment.experiment import Experiment

SHORT = 6.0
SILENT = Setup(seconds=SHORT, noise=0.0, drawn=0.0)


def everything(setup, **options):
    """All that is measured or stated, at common instants."""
    run = measure(3, setup, **options)
    grid = np.arange(round(setup.seconds * RATE) + 1) / RATE
    rows = [np.interp(grid, run.t_wrench, x) for x in (*run.force.T, *run.moment.T)]
    rows += [np.interp(grid, run.t_imu, x) for x in (*run.omega.T, *run.acceleration.T)]
    return np.concatenate([[run.mass], run.r_cg, *rows])


@pytest.mark.parametrize("still", [False, True])
def test_every_trouble_grows_with_its_size(still):
    """It changes what is measured or stated; a hundredth of it less, and nothing at all is left of none."""
    setup = Setup(seconds=4.0, still=still, noise=0.0, drawn=0.0)
    plain = everything(setup)
    for name, trouble in TROUBLES.items():
        if bool(trouble.still) != still:
            continue
        part = [everything(setup, **trouble.options(share * trouble.typical, 3)) - plain for share in (0, 0.01, 1)]
        none, small, large = (np.abs(change).sum() for change in part)
        assert none == 0, name
        assert large > 3 * small, name
        assert trouble.typical <= trouble.most


def test_there_are_many_troubles_and_those_with_sources_declare_them():
    assert len(TROUBLES) >= 25
    tables = []
    for name, trouble in TROUBLES.items():
        options = trouble.options(trouble.typical, 1)
        assert set(options) <= set(Setup.__dataclass_fields__), name
        tables += [laboratory_files.source(*table) for table in trouble.sources(trouble.typical)]
    experiment = Experiment.from_dict(laboratory_files.document(measure(0, SILENT), sources=tables))
    assert {table["name"] for table in tables} <= {source.name for source in experiment.sources}


def test_a_size_is_scaled_to_a_shift():
    u, missed = np.full(6, 1e-4), TROUBLES["still missed"]
    for name, within in (("gyro scale", 0.05), ("clock", 0.3)):  # in proportion, and not so
        size = size_for(TROUBLES[name], 20.0, u, 1, seconds=8.0)
        assert np.abs(shift(TROUBLES[name], size, 1, seconds=8.0) / u).max() == pytest.approx(20, rel=within)
    still = {"still": True, "seconds": 8.0}
    assert size_for(missed, 3.0, u, 1, **still) == missed.most
    small = size_for(missed, 3.0, u, 1, force_rows=True, **still)
    assert np.abs(shift(missed, small, 1, force_rows=True, **still) / u).max() == pytest.approx(3, rel=0.1)


@pytest.mark.slow  # of clean runs nothing is said: identify/judge/test_judge.py
def test_a_clean_run_stays_within_the_limits_of_the_judge():
    reached = judge_margins.margins(0)
    for name, (sign, limit) in judge_margins.LIMITS.items():
        assert reached[name] <= limit if sign == "≤" else reached[name] >= limit, name

"""Each planted fault still has its place in the source: one whose text is gone or stands twice would stop them all."""

from pathlib import Path

import pytest

from benchmarks.planted_faults import FAULTS, place


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_text_of_a_fault_stands_in_one_place(fault):
    place(Path(__file__).parents[2], fault)

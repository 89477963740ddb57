"""A wrong call of a public function is answered with the call as it should be."""

import re

import pytest

import identify
import uq


@pytest.mark.parametrize(
    ("function", "arguments", "call"),
    [
        (uq.montecarlo, (None, 200), "montecarlo(experiment, trials=200)"),
        (uq.paper, (100,), "paper(trials=100)"),
        (identify.identify, (None, (0, 0, 0)), "identify(runs, r_cg=…)"),
        (identify.ordinary_least_squares, (1, 2, 3, 200.0), "ordinary_least_squares(force, moment, omega, rate=200.0)"),
    ],
)
def test_the_public_functions_do_so(function, arguments, call):
    with pytest.raises(TypeError, match=re.escape(f"by their names: write {call}")):
        function(*arguments)

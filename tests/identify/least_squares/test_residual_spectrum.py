"""The errors' spectrum from residuals of short runs, against simulated errors of several colours."""

import numpy as np
import pytest

from identify.least_squares.residual_spectrum import Lines, spectrum
from identify.signals.filters import apply, gaussian, response
from tests.helpers.short_runs import RATE, Answers, Case, fitted, laboratory


def test_axes_that_drift_do_not_slope_the_spectrum_of_one_that_does_not(generator):
    """Behind a low-pass that closes all but 9 lines. 300 draws: the mean of the variance has 3 % standard error."""
    taps = gaussian(RATE, 10.0)
    lines = Lines.of([slice(0, 400)], RATE)
    gain = response(taps, RATE, lines.frequency) ** 2
    shown, there = [], []
    for _ in range(300):
        noise = generator.normal(size=(3, 400 + len(taps) - 1))
        noise[:2] = np.cumsum(noise[:2], axis=1)
        errors = lines.transform(apply(noise, taps).T)
        shown.append(spectrum(errors, np.ones(errors.shape), 1, gain).at(slice(1, 5))[:, 2, 2])
        there.append(errors[1:5, 2] ** 2)
    assert 0.75 < np.mean(shown) / np.mean(there) < 1.3


@pytest.mark.parametrize(
    "error", ["drift", *(pytest.param(error, marks=pytest.mark.slow) for error in ("turned", "follows, rig"))]
)
def test_errors_of_half_a_second_are_of_the_size_that_the_residuals_say(error):
    """40 runs behind a low-pass of 10 Hz: a ratio of some three independent components has 7 % standard error.

    A slope from all lines, those beyond the filter too, gives 1.5 to 1.7.
    """
    case = Case(0.5, "thrown", error, 10.0, "none")
    runs = [laboratory(case, seed) for seed in range(4)]
    answers = Answers.of([[fitted(case, [run], "source") for run in repeats] for repeats in runs])
    assert 0.7 < answers.mean_ratio < 1.3

"""What a load cell reads at rest, and how well its mean is known."""

import numpy as np

from identify.least_squares.offsets import rest_of
from identify.signals.run import Run
from identify.signals.segments import Segment

RATE, SECONDS = 100.0, 60
OFFSET = np.array([4.0, -7.0, 190.0, 0.3, -0.1, 0.7])
SIGMA = np.array([5.0, 5.0, 10.0, 0.4, 0.4, 0.5])


def test_the_mean_of_white_noise_is_known_to_sigma_over_root_n(generator):
    """60 blocks know a variance to 18 %, the mean of six to 8 %: four of these."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    wrench = OFFSET + SIGMA * generator.normal(size=(len(t), 6))
    rest = rest_of(Run(t, wrench[:, :3], wrench[:, 3:], np.zeros((len(t), 3))), [Segment(0.0, t[-1])])
    of_mean = SIGMA / np.sqrt(len(t))
    assert abs(np.mean(np.diag(rest.covariance) / of_mean**2) - 1) < 0.32
    assert (np.abs(np.concatenate([rest.force, rest.moment]) - OFFSET) < 5 * of_mean).all()
    assert rest_of(Run(t, wrench[:, :3], wrench[:, 3:], np.zeros((len(t), 3))), [Segment(0.0, 1.5)]) is None

"""What moves and what rests in a recording, and which motion counts."""

import numpy as np
import pytest

from identify.signals.segments import moving, still

RATE = 400.0


def test_a_run_without_rest_moves_throughout(generator):
    t = np.arange(0, 5, 1 / RATE)
    omega = 6 * np.sin(2 * np.pi * np.multiply.outer(t, [1.0, 1.2, 1.4])) + generator.normal(0, 1e-3, (len(t), 3))
    (segment,) = moving(RATE, omega)
    assert (segment.start, segment.stop) == (0, pytest.approx(t[-1]))
    assert still(RATE, omega) == ()
    throw = omega[:200] + [5.0, 2.0, 1.0]
    assert moving(RATE, throw) == ((0, pytest.approx(199 / RATE)),)


@pytest.mark.parametrize("bias", [0.0, 0.05])
def test_a_rig_at_rest_rests_with_its_hum_and_its_bias(generator, bias):
    t = np.arange(0, 20, 1 / RATE)
    hum = 0.05 * np.sin(2 * np.pi * 48 * t)[:, None]
    omega = hum + bias + generator.normal(0, 2e-3, (len(t), 3))
    assert moving(RATE, omega) == ()
    assert sum(segment.seconds for segment in still(RATE, omega)) > 15


def test_a_slow_turn_about_one_axis_is_no_rest(generator):
    t = np.arange(0, 40, 1 / RATE)
    omega = generator.normal(0, 1e-3, (len(t), 3))
    omega[4000:8000, 2] += 0.3
    (segment,) = moving(RATE, omega)
    assert segment.start == pytest.approx(10, abs=0.4)
    assert segment.stop == pytest.approx(20, abs=0.4)

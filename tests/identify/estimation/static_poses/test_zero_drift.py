"""A zero that drifts over static poses: estimated along, and told apart from creep and from turned axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.attitude_turn import attitude_turn
from identify.estimation.static_poses.centre import centre

MASS, R_CG, G = 2.0, np.array([0.02, -0.03, 0.048]), 9.81
DRIFT = np.array([1.0, 0.5, 4.0, 0.02, 0.03, -0.01])
DRIFTS, LAGS = "zero drifts", "lag behind the load"


def poses(seed, *, count=60, slow=True, drift=0.0, shape=lambda x: x, lag=0.0, turn=0.0):
    """Force, moment and specific force; in small steps or at random, with a drift, a lag, or axes that are turned."""
    draw = np.random.default_rng(seed)
    steps = np.linspace(0, 1, count)
    if slow:
        angles = np.stack([np.sin(2.1 * np.pi * steps), np.cos(3.3 * np.pi * steps), 0.4 * steps], axis=1)
        attitude = Rotation.from_euler("xyz", angles + draw.uniform(-0.3, 0.3, 3))
    else:
        attitude = Rotation.random(count, rng=draw)
    f = attitude.inv().apply([0, 0, G])
    wrench = np.hstack([MASS * f, np.cross(MASS * R_CG, f)])
    before = np.vstack([wrench[:1], wrench[:-1]])
    wrench = wrench + lag * (before - wrench) + drift * shape(steps)[:, None] * DRIFT
    wrench += draw.normal(size=wrench.shape) * np.repeat([0.02, 1e-3], 3)
    seen = Rotation.from_rotvec([0, turn, 0]).apply(f)
    return wrench[:, :3], wrench[:, 3:], seen


@pytest.mark.parametrize("slow", [True, False], ids=["in small steps", "at random"])
@pytest.mark.parametrize("count", [24, 60])
@pytest.mark.parametrize(
    "shape", [lambda x: x, lambda x: (1 - np.exp(-2 * x)) / (1 - np.exp(-2))], ids=["line", "bent"]
)
def test_a_drift_is_named_and_the_truth_is_within_the_interval(slow, count, shape):
    result = centre(*poses(1, count=count, slow=slow, drift=1.0, shape=shape))
    text = " ".join(result.warnings)
    assert (DRIFTS in text, LAGS in text) == (True, False)
    assert abs(result.mass - MASS) < 4 * result.standard_uncertainty[0] < 0.01
    assert (np.abs(result.r_cg - R_CG) < 4 * result.standard_uncertainty[1:4] + 2e-4).all()


def test_drift_creep_and_turned_axes_are_each_named_alone():
    for slow in (True, False):
        force, moment, f = poses(2, slow=slow, drift=1.0)
        drifting = centre(force, moment, f)
        assert attitude_turn(force, f, drifting.further[:, :3]) is None
        text = " ".join(centre(*poses(2, slow=slow, lag=0.02)).warnings)
        assert (DRIFTS in text, LAGS in text) == (False, True)
        turned = poses(2, slow=slow, turn=0.07)
        assert DRIFTS not in " ".join(centre(*turned).warnings)
        assert attitude_turn(turned[0], turned[2]) is not None


def test_both_drift_and_creep_are_estimated_where_both_show():
    result = centre(*poses(3, slow=False, drift=1.0, lag=0.05))
    text = " ".join(result.warnings)
    assert (DRIFTS in text, LAGS in text) == (True, True)
    assert abs(result.mass - MASS) < 4 * result.standard_uncertainty[0]


def test_the_time_counts_where_it_is_given():
    """Half of the poses are held in the last tenth of the time."""
    time = np.concatenate([np.linspace(0, 0.9, 30), np.linspace(0.903, 1, 30)])
    force, moment, f = poses(4)
    wrench = np.hstack([force, moment]) + time[:, None] * DRIFT
    result = centre(wrench[:, :3], wrench[:, 3:], f, progress=1e3 * time)
    assert DRIFTS in " ".join(result.warnings)
    assert result.further.shape[2] == 6  # a line
    assert abs(result.mass - MASS) < 4 * result.standard_uncertainty[0]


def test_sound_poses_have_no_drift():
    """Chance of a false alarm 0.1 % each."""
    named = [
        any(DRIFTS in text for text in centre(*poses(seed, count=(10, 24, 60)[seed % 3], slow=seed % 2 == 0)).warnings)
        for seed in range(40)
    ]
    assert sum(named) == 0

"""A turn between the attitude's axes and the load cell's: against the turn that made the poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.attitude_turn import attitude_turn


def poses(generator, turn, *, count=14, noise=0.02):
    """Forces of a body of 7.5 kg that turns all ways, and specific forces along axes that are turned against them."""
    up = generator.normal(size=(count, 3))
    specific_force = 9.81 * up / np.linalg.norm(up, axis=1, keepdims=True)
    force = 7.5 * specific_force + [3.0, -5.0, 8.0] + noise * generator.normal(size=up.shape)
    return force, Rotation.from_rotvec(turn).inv().apply(specific_force)


def test_the_turn_is_found_with_its_uncertainty(generator):
    """3 degrees about (1, 2, 2): over a hundred series the deviations are those that are stated; 4 standard errors."""
    turn = np.radians([1.0, 2.0, 2.0])
    apart = []
    for _ in range(100):
        found = attitude_turn(*poses(generator, turn))
        assert found is not None
        apart.append((found.vector - turn) / found.standard_uncertainty)
    # Student's t of 35 degrees of freedom has the variance 35/33
    assert np.square(apart).mean() == pytest.approx(35 / 33, abs=4 * np.sqrt(2.2 / 300))
    np.testing.assert_allclose(found.matrix, Rotation.from_rotvec(turn).as_matrix(), atol=2e-3)


def test_a_large_turn_is_found_exactly(generator):
    turn = np.radians([10.0, -20.0, 15.0])
    found = attitude_turn(*poses(generator, turn, noise=0.0))
    np.testing.assert_allclose(found.vector, turn, atol=1e-7)


@pytest.mark.parametrize(("turn", "options"), [
    (0.0, {}), (0.0, {"noise": 0.0}), (np.radians(0.2), {}), (np.radians(2.0), {"count": 5}), (np.radians(0.6), {"noise": 3.0}),
])  # fmt: skip
def test_what_mounting_or_chance_makes_is_no_turn(generator, turn, options):
    assert attitude_turn(*poses(generator, np.array([turn, 0.0, 0.0]), **options)) is None

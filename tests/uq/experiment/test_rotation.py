"""Rotations, units and the gravity of a place in experiment files."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uq.experiment.experiment import Experiment
from uq.experiment.recording_table import RecordingTable
from uq.files.schema import declared_table
from uq.files.units import scale


def recording(**content):
    return declared_table("recording", content, RecordingTable)


def test_the_three_ways_to_write_a_rotation_agree():
    half = 0.5**0.5
    ways = ("-y, x, z", {"w": half, "x": 0, "y": 0, "z": half}, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for way in ways:
        rotation = recording(imu_rotation_to_body=way).imu_rotation_to_body
        np.testing.assert_allclose(rotation, Rotation.from_euler("z", 90, degrees=True).as_matrix(), atol=1e-15)


def test_what_is_not_declared_is_none():
    silent = recording()
    assert silent.offsets == "estimate"
    declared = {name for name, value in silent.to_dict().items() if value is not None}
    assert declared == {"offsets", "alignment", "method", "drawn_by_mounting"}
    assert silent.to_dict() == RecordingTable().to_dict()


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [("lbf", "N", 4.4482216152605), ("kgf", "N", 9.80665), ("N*mm", "N*m", 1e-3), ("deg/s", "rad/s", np.pi / 180),
     ("g", "m/s^2", 9.80665), ("lbf*inch", "N*m", 0.1129848290276167)],
)  # fmt: skip
def test_units_by_name(name, unit, factor):
    assert scale(name, unit) == pytest.approx(factor, rel=1e-14)


def test_gravity_of_a_place_is_the_experiments(preset):
    document = dict(preset.document) | {"platform": {"gravity": {"latitude": "4.6 deg", "height": "2600 m"}}}
    assert Experiment.from_dict(document).gravity == pytest.approx(9.7736, abs=1e-3)

"""Tables of static poses in other units, axes and signs: what is named, and that a cure, obeyed, leads to the truth."""

import re
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.signals.run import RunError
from tests.helpers.posed_runs import MASS, R_CG, ZERO, G
from uq.experiment.experiment import Experiment
from uq.runs.identification.static_centre import centre_file

FORCE, MOMENT = ["fx", "fy", "fz"], ["tx", "ty", "tz"]
SCALE = {"scale": {"mass": "2 kg", "standard_uncertainty": "1 g"}}
BODY = {"body": {"r_cg_from_q": ["20 mm", "-30 mm", "48 mm"]}}
KILOGRAM_FORCE = 9.80665
LEFT, ON_SENSOR = np.diag([-1.0, 1, 1]), {"wrench": "on_sensor"}
TURN = np.array([[0, -1.0, 0], [0, 0, 1], [-1, 0, 0]])
"""From an accelerometer's axes to the load cell's."""


class Table:
    """24 poses of a body, whose wrench and attitude may be spoiled."""

    def __init__(self, path, *, tilt=None, attitude="quaternion", mass=MASS, r_cg=R_CG, seed=3, count=24, noise=1.0):
        rng = np.random.default_rng(seed)
        tilted = Rotation.random(count, rng=rng) if tilt is None else None
        self.turn = tilted or Rotation.from_euler("xy", rng.uniform(-tilt, tilt, (count, 2)))
        self.f = G * self.turn.as_matrix()[:, 2]
        shake = noise * rng.normal(size=(2, count, 3))
        self.force = mass * self.f + ZERO[:3] + 0.02 * shake[0]
        self.moment = np.cross(r_cg, mass * self.f) + ZERO[3:] + 1e-3 * shake[1]
        self.readings, self.path, self.attitude = self.f, path / "p.csv", attitude
        self.more = {}
        """Further keys of [poses]."""

    def centre(self, recording=None, **more):
        """The centre by the table, as declared."""
        sensed = self.attitude != "quaternion"
        sign = -1 if self.attitude == "gravity" else 1
        values, names = (sign * self.readings, list("abc")) if sensed else (self.turn.as_quat(), list("xyzw"))
        rows = np.hstack([self.force, self.moment, values])
        np.savetxt(self.path, rows, delimiter=",", header=",".join([*FORCE, *MOMENT, *names]), comments="")
        by = {self.attitude: names} if sensed else {"quaternion": dict(zip("xyzw", names, strict=True))}
        poses = {"force": FORCE, "moment": MOMENT, **by} | ({} if sensed else {"takes": "sensor_to_level"})
        tables = {"platform": {"gravity": f"{G} m/s^2"}, "recording": {"wrench": "on_body"} | (recording or {})}
        return centre_file(self.path, Experiment.from_dict({**tables, "poses": poses | self.more, **more}))

    def told(self, recording=None, **more):
        """What is suspicious."""
        try:
            texts = self.centre(recording, **more).warnings
        except RunError as error:
            texts = (str(error),)
        return [text for text in texts if text.startswith("suspicious")]

    def is_sound(self, recording, r_cg=R_CG, **more):
        """Nothing is suspicious, and the centre is the true one: errors of 0.1 mm by noise, five times as many pass."""
        centre = self.centre(recording, **more)
        assert not centre.warnings
        assert centre.mass == pytest.approx(MASS, abs=5e-3)
        np.testing.assert_allclose(centre.r_cg, r_cg, atol=5e-4)


def line(text, key):
    """The value that a message tells for a key."""
    return tomllib.loads(re.search(rf"{key} = (?:\[\[.*?\]\]|\"[^\"]*\")", text)[0])[key]


UNITS = {
    "N*mm": ((1.0, 1e-3), {"moment_unit": "N*mm"}),
    "N*cm": ((1.0, 1e-2), {"moment_unit": "N*cm"}),
    "kgf, N*m": ((KILOGRAM_FORCE, 1.0), {"force_unit": "kgf"}),
    "kgf*cm": ((KILOGRAM_FORCE, KILOGRAM_FORCE * 1e-2), {"force_unit": "kgf", "moment_unit": "kgf*cm"}),
    "mN": ((1e-3, 1.0), {"force_unit": "mN"}),
    "kN": ((1e3, 1.0), {"force_unit": "kN"}),
}


@pytest.mark.parametrize("unit", UNITS)
def test_other_units_are_named_and_obeyed_lead_to_the_truth(tmp_path, unit):
    """By a lever of metres or micrometres; with a scale, the pair that is right comes first."""
    (of_force, of_moment), cure = UNITS[unit]
    table = Table(tmp_path, attitude="acceleration")
    table.force, table.moment = table.force / of_force, table.moment / of_moment
    lines = " and ".join(f'{key} = "{value}"' for key, value in cure.items())
    (alone,) = table.told()
    assert f"{lines} (2.0" in alone
    (weighed,) = table.told(**SCALE)
    assert f"set {lines} (2.0" in weighed
    assert "a declared mass" not in weighed
    table.is_sound(cure, **SCALE)


def test_declared_units_that_are_not_those_of_the_table_are_named(tmp_path):
    """N·mm declared of N·m: every lever is a thousandth, the scatter's too."""
    table = Table(tmp_path)
    (text,) = table.told({"moment_unit": "N*mm"})
    assert 'set moment_unit = "N*m" (2.00 kg, 60.' in text


def test_a_declared_mass_that_no_unit_explains_is_named(tmp_path):
    (text,) = Table(tmp_path).told(body={"mass": "2.6 kg"})
    assert "the force is the weight of 2.00 kg, the declared mass is 2.60 kg" in text


@pytest.mark.parametrize("attitude", ["quaternion", "acceleration", "gravity"])
def test_a_left_handed_load_cell_is_named_as_of_runs(tmp_path, attitude):
    table = Table(tmp_path, attitude=attitude)
    table.force, table.moment = table.force @ LEFT, table.moment @ LEFT
    (text,) = table.told()
    assert "the load cell's axes are left-handed" in text
    assert ("or the accelerometer's axes are left-handed" in text) == (attitude == "acceleration")
    table.is_sound(ON_SENSOR | {"wrench_rotation_to_body": line(text, "wrench_rotation_to_body")})


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("degrees", [0.0, 1.5])
def test_axes_of_an_accelerometer_come_before_a_sign(tmp_path, sign, degrees):
    """In another order, and besides a little off: one obeyed line, and the sign where it is reversed."""
    table = Table(tmp_path, attitude="acceleration")
    turn = TURN @ Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, 0.0, 0.8])).as_matrix()
    table.readings = table.f @ turn
    table.force, table.moment = sign * table.force, sign * table.moment
    (text,) = table.told()
    assert ("on_sensor" in text) == (sign < 0)
    cure = {"imu_rotation_to_body": line(text, "imu_rotation_to_body")}
    table.is_sound(cure | (ON_SENSOR if sign < 0 else {}))
    (decided,) = table.told(**BODY)
    assert "otherwise" not in decided


def test_a_sign_and_half_a_turn_are_both_named_where_small_tilts_do_not_tell_them(tmp_path):
    table = Table(tmp_path, tilt=0.05, attitude="acceleration", noise=2.0)
    table.readings = table.f @ np.diag([-1.0, -1.0, 1.0])
    text = " ".join(table.told())
    assert 'wrench = "on_sensor"' in text
    assert 'imu_rotation_to_body = "-x, -y, z"' in text


@pytest.mark.parametrize(
    ("attitude", "reading"),
    [("quaternion", "urdf_gravity"), ("acceleration", "accelerometer_at_rest"), ("gravity", "gravity_points")],
)
def test_a_reversed_wrench_and_a_force_alone_are_told_by_the_declared_centre(tmp_path, attitude, reading):
    table = Table(tmp_path, attitude=attitude)
    table.force = -table.force
    (text,) = table.told()
    for part in ('wrench = "on_sensor"', f"{reading}", "calibration = [[-1, 0", "(20.0, −30.0, 48.0) mm"):
        assert part in text
    (decided,) = table.told(**BODY)
    assert "the force alone has the reversed sign; the attitudes fit only so, by the declared centre" in decided
    table.is_sound({"calibration": line(decided, "calibration")}, **BODY)
    table.moment = -table.moment
    (both,) = table.told(**BODY)
    assert "calibration" not in both
    table.is_sound(ON_SENSOR, **BODY)


def test_vectors_of_gravity_that_point_up_are_named_and_declared(tmp_path):
    table = Table(tmp_path, attitude="gravity")
    table.readings = -table.readings
    (text,) = table.told(**BODY)
    assert "the vectors of gravity point up" in text
    assert 'gravity_points = "up" in [poses]' in text
    table.more = {"gravity_points": line(text, "gravity_points")}
    table.is_sound(None, **BODY)


@pytest.mark.slow
def test_of_sound_poses_nothing_is_suspected(tmp_path):
    """None of 120, of 0.2 to 50 kg and up to 300 mm: at most 2.5 % of such tables (95 %)."""
    for seed in range(120):
        rng = np.random.default_rng([seed, 1])
        mass, aim = float(np.exp(rng.uniform(np.log(0.2), np.log(50.0)))), rng.normal(size=3)
        r_cg = (0.0, rng.uniform(0.0, 0.3), 0.3)[seed % 3] * aim / np.linalg.norm(aim)
        about = [{}, {"scale": {"mass": f"{mass} kg", "standard_uncertainty": "5 g"}}, {"body": {"mass": f"{mass} kg"}}]
        table = Table(
            tmp_path, mass=mass, r_cg=r_cg, seed=seed, count=int(rng.choice([6, 12, 24])),
            tilt=(None, None, 0.2)[seed % 3], attitude=("quaternion", "acceleration", "gravity")[seed // 3 % 3],
            noise=min(1.0, mass / 2) * rng.uniform(0.5, 5.0),
        )  # fmt: skip
        assert table.told(**about[seed // 9 % 3]) == []

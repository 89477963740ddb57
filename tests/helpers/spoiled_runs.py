"""Runs of simulated bodies, and ways to spoil them as a careless rig would, each with the declaration that cures it."""

import copy
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identify.rigid_body.rotation import exponential
from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate

ROOT = Path(__file__).parents[2]
T1 = tomllib.loads((ROOT / "uq" / "examples" / "t1-10s.toml").read_text())
TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
EYE = np.eye(3)
SWAP = EYE[[1, 0, 2]]
GRAVITY = np.array([0.0, 0.0, 9.81])


@dataclass(frozen=True, eq=False)
class Sensors:
    """What the two sensors of a simulated run recorded, and the truth behind it."""

    wrench: WrenchChannel
    imu: ImuChannel
    experiment: Experiment
    gravity: np.ndarray

    def write(self, path):
        runs.write(path, wrench=self.wrench, imu=self.imu)
        return path

    def of_wrench(self, force=EYE, moment=None):
        moment = force if moment is None else moment
        wrench = replace(self.wrench, force=self.wrench.force @ force.T, moment=self.wrench.moment @ moment.T)
        return replace(self, wrench=wrench)

    def of_imu(self, omega=EYE, acceleration=None):
        acceleration = omega if acceleration is None else acceleration
        imu = replace(
            self.imu,
            angular_velocity=self.imu.angular_velocity @ omega.T,
            linear_acceleration=self.imu.linear_acceleration @ acceleration.T,
        )
        return replace(self, imu=imu)

    def without(self, force, moment):
        wrench = replace(self.wrench, force=self.wrench.force - force, moment=self.wrench.moment - moment)
        return replace(self, wrench=wrench)


def sensors(document, trajectory="T1", *, seed=0, imu_at=(0.0, 0.0, 0.0), noise=0.0):
    """Simulate, with the accelerometer at a place of its own and with its own white noise and bias [m/s²]."""
    experiment = Experiment.from_dict(document)
    simulated = simulate(experiment, trajectory, seed=seed)
    run, draw = simulated.run, np.random.default_rng(seed)
    stamp = np.round(run.t * 1e9).astype(np.int64)
    omega, alpha = run.omega, np.gradient(run.omega, 1 / run.rate, axis=0)
    at_imu = simulated.specific_force + np.cross(alpha, imu_at) + np.cross(omega, np.cross(omega, imu_at))
    at_imu = at_imu + noise * (draw.normal(size=at_imu.shape) + draw.normal(size=3))
    gravity = np.einsum("nji,j->ni", simulated.rotation, GRAVITY)
    return Sensors(
        WrenchChannel("/wrench", "body", stamp, stamp, run.force, run.moment),
        ImuChannel("/imu", "body", stamp, stamp, omega, at_imu),
        experiment,
        gravity,
    )


def weight(run):
    """Force and moment about Q that hold the body up, [N] and [N·m]."""
    force = run.experiment.mass * run.gravity
    return force, np.cross(np.asarray(run.experiment.r_cg_from_q), force)


def loaded(run):
    return run.without(run.wrench.force[:40].mean(axis=0), run.wrench.moment[:40].mean(axis=0))


def elsewhere(run, point):
    """The moment about another point: M_P = M_Q - p × F."""
    return run.without(0.0, np.cross(point, run.wrench.force))


POINT = np.array([0.02, 0.0, 0.04])
SPOILED = {
    "opposite sign": ("sign", lambda r: r.of_wrench(-np.eye(3)), {"wrench": "on_sensor"}),
    "rotated IMU": ("axes", lambda r: r.of_imu(TURN), {"imu_rotation_to_body": "-y, x, z"}),
    "permuted load-cell axes": ("axes", lambda r: r.of_wrench(TURN), {"wrench_rotation_to_body": "-y, x, z"}),
    "mirrored load cell": (
        "mirror",
        lambda r: r.of_wrench(SWAP),
        {"wrench": "on_sensor", "wrench_rotation_to_body": "-y, -x, -z"},
    ),
    "mirrored IMU": ("mirror", lambda r: r.of_imu(np.diag([1.0, 1.0, -1.0])), None),
    "moment in N·mm": ("unit", lambda r: r.of_wrench(np.eye(3), 1e3 * np.eye(3)), {"moment_unit": "N*mm"}),
    "force in lbf": ("unit", lambda r: r.of_wrench(np.eye(3) / 4.4482216152605, np.eye(3)), {"force_unit": "lbf"}),
    "force in kgf": ("unit", lambda r: r.of_wrench(np.eye(3) / 9.80665, np.eye(3)), {"force_unit": "kgf"}),
    "gyro in deg/s": (
        "unit",
        lambda r: r.of_imu(np.degrees(1.0) * np.eye(3), np.eye(3)),
        {"angular_velocity_unit": "deg/s"},
    ),
    "acceleration in g": ("unit", lambda r: r.of_imu(np.eye(3), np.eye(3) / 9.80665), {"acceleration_unit": "g"}),
    "moment at another point": ("point", lambda r: elsewhere(r, POINT), {"wrench_point": ["20 mm", "0 mm", "40 mm"]}),
    "zeroed loaded": ("weight", loaded, {"zero": "loaded"}),
    "gravity-compensated": ("weight", lambda r: r.without(*weight(r)), {"compensated": "gravity"}),
    "gravity taken off the force only": (
        "weight",
        lambda r: r.without(weight(r)[0], 0.0),
        {"compensated": "gravity_from_force"},
    ),
}


def declared(document, recording):
    """The experiment's document with more in its table [recording]."""
    document = copy.deepcopy(document)
    document["recording"] = document.get("recording", {}) | (recording or {})
    return document


def other_body(seed):
    """T1 to T4 in ten seconds for a body of 0.5 to 120 kg of some density and CG, with sensors that suit it."""
    draw = np.random.default_rng(seed)
    mass = float(np.exp(draw.uniform(np.log(0.5), np.log(120.0))))
    size = float((mass / np.exp(draw.uniform(np.log(300.0), np.log(8000.0)))) ** (1 / 3))
    axes = exponential(draw.normal(size=3))
    second = mass * size**2 / 4 * axes @ np.diag(draw.uniform(0.2, 1.0, 3)) @ axes.T
    tensor = np.trace(second) * np.eye(3) - second
    r_cg = 0.5 * size * draw.normal(size=3)
    preset = Experiment.load("barreto2016").document
    document = copy.deepcopy(dict(preset))
    names = {"I11": (0, 0), "I12": (0, 1), "I13": (0, 2), "I22": (1, 1), "I23": (1, 2), "I33": (2, 2)}
    document["body"] = {
        "mass": f"{mass} kg",
        "r_cg_from_q": [f"{x} m" for x in r_cg],
        "inertia": {name: f"{tensor[at]} kg*m^2" for name, at in names.items()},
    }
    for trajectory in document["trajectory"].values():
        trajectory |= {"duration": "10 s", "ramp": "1.5 s"} | ({"precessions": 2} if "pole" in trajectory else {})
    share = min(1.0, mass / 10) * float(np.exp(draw.uniform(np.log(0.03), 0.0)))
    for source in document["source"]:
        if source["target"] in ("F", "M"):
            source["sigma"] = [f"{share * float(x.split()[0])} {x.split()[1]}" for x in source["sigma"]]
    document["recording"] = {"estimator": "smoothed"}
    place = 0.1 * draw.normal(size=3)
    return sensors(document, f"T{seed % 4 + 1}", seed=seed, imu_at=place, noise=0.02)

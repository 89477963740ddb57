"""Small experiments with chosen sources, and an independent simulation of what each does, in plain NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import SamplingPlan
from uq.monte_carlo.campaign.trial_setup import true_motion
from uq.sources.draws import draw_pairs, noise_streams
from uq.sources.random_normals import in_order

BODY = {
    "mass": "19.7 kg",
    "r_cg_from_q": ["4 mm", "-7 mm", "53 mm"],
    "inertia": {"I11": "381.3 g*m^2", "I12": "6 g*m^2", "I13": "-9 g*m^2", "I22": "18.5 g*m^2", "I23": "2 g*m^2",
                "I33": "379.1 g*m^2"},
}  # fmt: skip
TRAJECTORY = {
    "kind": "sphere", "still": "omb", "angular_velocity": "0.425 rad/s", "angular_acceleration": "4 rad/s^2",
    "duration": "4 s", "rate": "100 Hz", "ramp": "1 s", "precessions": 2, "pole": "b2",
}  # fmt: skip
ESTIMATORS = [
    {"name": "central", "differentiator": "central"},
    {"name": "smoothed", "differentiator": "savitzky-golay", "window": 7},
]


BY_SAMPLES = SamplingPlan(engine="samples")
IN_FLOAT32 = SamplingPlan(engine="samples", dtype="float32")


def one_trial(engine, key, index):
    """One trial of an engine."""
    return jax.tree.map(lambda leaf: leaf[0], engine.run(key, index[None]))


def draw_block(source, key, trial, block, dtype):
    """One block of a precision source that is correlated with no other, (3, 1200)."""
    return in_order(draw_pairs([source], (), noise_streams([source], key, trial), block, dtype)[0])


def source(name, target, kind, **keys):
    return {"name": name, "target": target, "kind": kind, "group": f"group of {name}", **keys}


def experiment(*sources, correlations=(), folder=".", **trajectory):
    return Experiment.from_dict(
        {
            "body": BODY,
            "platform": {"gravity": "9.81 m/s^2", "r_cg_from_omb": ["10 mm", "-20 mm", "0.11 m"]},
            "trajectory": {"T": TRAJECTORY | trajectory},
            "estimator": ESTIMATORS,
            "source": list(sources),
            "correlation": list(correlations),
        },
        folder,
    )


def tensor_of(packed):
    i11, i12, i13, i22, i23, i33 = packed
    return np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])


def simulated(e, *, gravity=0.0, cg=0.0, tilt=(0, 0, 0), displaced=(0.0, (0, 0, 0)), entrained=(0.0, (0, 0, 0), (0, 0, 0)),
              cell_turn=(0, 0, 0), cross_talk=0.0, cell_scale=0.0, cell_offset=0.0, cell_slope=0.0,
              gyro_turn=(0, 0, 0), gyro_scale=0.0, gyro_offset=0.0, gyro_slope=0.0, delay=0.0):  # fmt: skip
    """Return what the sensors say, wrench (n, 6) and omega (n, 3): Newton and Euler, mass by mass, sample by sample."""
    spec = e.trajectories["T"]
    motion = true_motion(e, spec)
    t, omega, alpha = np.array(motion.t), np.array(motion.omega.T), np.array(motion.alpha.T)
    turned = Rotation.from_rotvec(tilt) * Rotation.from_matrix(np.array(motion.rotation))
    up = turned.inv().apply([0, 0, 1]) * (e.gravity + gravity)  # -g in B
    r, tensor = e.r_cg_from_q, tensor_of(e.inertia)
    still = (e.r_cg_from_omb if spec.still == "omb" else 0) + np.ones(
        3
    ) * cg  # the centre of gravity, from what keeps still

    def acceleration(point):
        return np.cross(alpha, point) + np.cross(omega, np.cross(omega, point))

    force = e.mass * (acceleration(still) + up)
    moment = alpha @ tensor + np.cross(omega, omega @ tensor) + np.cross(r, force)
    mass, centre = displaced
    force, moment = force - mass * up, moment - np.cross(r + centre, mass * up)
    mass, centre, radii = entrained
    push = mass * acceleration(still + centre)
    own = mass * np.square(radii)
    force = force + push
    moment = moment + np.cross(r + centre, push) + alpha * own + np.cross(omega, omega * own)
    own_axes = Rotation.from_rotvec(cell_turn).inv()
    wrench = np.hstack([own_axes.apply(force), own_axes.apply(moment)])
    wrench = (wrench + wrench @ (cross_talk * np.ones((6, 6))).T) * (1 + cell_scale * np.ones(6))
    wrench = wrench + cell_offset * np.ones(6) + np.outer(t, cell_slope * np.ones(6))
    if delay:
        omega = np.array(jax.vmap(spec.trajectory.omega)(jnp.asarray(t - delay)))
    said = Rotation.from_rotvec(gyro_turn).inv().apply(omega) * (1 + gyro_scale * np.ones(3))
    return wrench, said + gyro_offset * np.ones(3) + np.outer(t, gyro_slope * np.ones(3))


def least_squares(e, wrench, omega, r_cg, estimator):
    """Return the packed tensor by explicit rows and NumPy's least squares, over the samples that all estimators share."""
    rate = e.trajectories["T"].rate
    halo = max(len(one.taps(rate)) for one in e.estimators)
    taps = e.estimator(estimator).taps(rate)
    n = len(omega)
    alpha = sum(c * (omega[halo + j : n - halo + j] - omega[halo - j : n - halo - j]) for j, c in enumerate(taps, 1))
    w, f, m = omega[halo : n - halo], wrench[halo : n - halo, :3], wrench[halo : n - halo, 3:]
    basis = np.array([tensor_of(unit) for unit in np.eye(6)])
    rows = np.einsum("kij,nj->nik", basis, alpha) + np.cross(w[:, None], np.einsum("kij,nj->nki", basis, w)).transpose(
        0, 2, 1
    )
    return np.linalg.lstsq(rows.reshape(-1, 6), (m - np.cross(r_cg, f)).ravel(), rcond=None)[0]

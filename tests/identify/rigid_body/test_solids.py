"""Solids and composites against MuJoCo's geoms and against points drawn at random inside them."""

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.rigid_body.solids import Part, composite, cuboid, cylinder, sphere

DENSITY = 2700.0


def part(solid, position=(0.0, 0, 0), rotation=None, sign=1.0):
    turn = np.eye(3) if rotation is None else rotation
    return Part(sign * DENSITY * solid.volume, solid.mean_squares, turn, jnp.array(position, float))


def matrix(six):
    i11, i12, i13, i22, i23, i33 = six
    return np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])


def test_a_composite_is_that_of_mujocos_geoms(generator):
    """Two each of cylinder, cuboid and sphere at random poses."""
    parts, geoms = [], []
    for kind in ("cylinder", "box", "sphere") * 2:
        turn, place = Rotation.random(rng=generator), generator.normal(scale=0.1, size=3)
        size = generator.uniform(0.02, 0.2, 3)
        solid = {
            "cylinder": lambda s: cylinder(2 * s[0], 2 * s[1]),
            "box": lambda s: cuboid(jnp.asarray(2 * s)),
            "sphere": lambda s: sphere(2 * s[0]),
        }[kind](size)
        parts.append(part(solid, place, turn.as_matrix()))
        spelled = {"size": size, "pos": place, "quat": turn.as_quat(scalar_first=True)}
        text = " ".join(f'{name}="{" ".join(map(repr, map(float, values)))}"' for name, values in spelled.items())
        geoms.append(f'<geom type="{kind}" density="{DENSITY}" {text}/>')
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><freejoint/>{''.join(geoms)}</body></worldbody></mujoco>"
    )
    turn = Rotation.from_quat(model.body_iquat[1], scalar_first=True).as_matrix()
    mass, r_cg, inertia = np.split(np.asarray(composite(parts)), [1, 4])
    assert mass[0] == pytest.approx(model.body_mass[1], rel=1e-12)
    np.testing.assert_allclose(r_cg, model.body_ipos[1], rtol=1e-10)
    np.testing.assert_allclose(matrix(inertia), turn @ np.diag(model.body_inertia[1]) @ turn.T, rtol=0, atol=1e-10)


def test_hollow_solids_and_holes_against_random_points(generator):
    """A tube, a hollow ball and a cuboid with a bore: moments within 4.5 standard errors of a million points.

    Thirty figures: a false alarm has the chance of 2e-4.
    """
    bored = [cuboid(jnp.array([0.1, 0.12, 0.3])), cylinder(0.05, 0.3)]
    cases = [
        ([part(cylinder(0.2, 0.3, 0.12))], lambda p: _tube(p, 0.2, 0.12, 0.3)),
        ([part(sphere(0.3, 0.2))], lambda p: np.abs(np.linalg.norm(p, axis=1) - 0.125) < 0.025),
        (
            [part(bored[0]), part(bored[1], (0.01, 0.02, 0.0), sign=-1.0)],
            lambda p: (np.abs(p) < [0.05, 0.06, 0.15]).all(axis=1) & ~_tube(p - [0.01, 0.02, 0], 0.05, 0.0, 0.3),
        ),
    ]
    for parts, inside in cases:
        box = np.array([0.32, 0.32, 0.32])
        points = generator.uniform(-box / 2, box / 2, (1_000_000, 3))
        weights = DENSITY * box.prod() * inside(points)
        parameters = np.asarray(composite(parts))
        x, y, z = (points - parameters[1:4]).T
        per_point = np.stack([np.ones_like(x), x, y, z, y**2 + z**2, -x * y, -x * z, x**2 + z**2, -y * z, x**2 + y**2])
        samples = weights * per_point
        error = samples.std(axis=1) / np.sqrt(len(points))
        expected = np.concatenate([parameters[:1], np.zeros(3), parameters[4:]])
        assert (np.abs(samples.mean(axis=1) - expected) < 4.5 * error).all()


def _tube(points, outer, inner, length):
    across = np.hypot(points[:, 0], points[:, 1])
    return (across < outer / 2) & (across >= inner / 2) & (np.abs(points[:, 2]) < length / 2)

"""Motions in stages: the formula, cross-fades, files, exports, predictions, and the mixture of patterns behind them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from identify.inertia import MOMENTS, PRODUCTS
from identify.patterns import PATTERNS, mixture, optimal_shares, steepness
from identify.periodic import Periodic, moved
from identify.platform_motion import Limits, platform_motion
from identify.stages import Stages
from identify.trajectory import Multisine, attitude, exponential, window
from uq.design_bound import average
from uq.design_reference import scaled
from uq.experiment import Experiment, ExperimentError
from uq.lasting import lasting, shortest
from uq.motion_export import export_motion
from uq.multisine_table import COLUMNS, START, multisine_csv

DURATION, RAMP = 12.0, 1.0
STARTS = (0.0, 3.0, 7.0)
NOISE = np.diag([0.2, 0.3, 0.25])


@pytest.fixture(scope="module")
def staged():
    """Three stages of two sines each."""
    generator = np.random.default_rng(5)
    size = np.repeat([0.001, 0.02], 3)[:, None]
    amplitudes = generator.normal(size=(2, 6, 6)) * size
    frequency = np.array([0.5, 1.0, 0.5, 1.0, 0.7, 1.4])
    return Multisine(frequency, *amplitudes, np.array(DURATION), np.array(RAMP), np.repeat(STARTS, 2))


def only(motion, first):
    """One stage of a motion as a motion of one stage."""
    part = np.asarray(motion.start) == first
    amplitudes = {"cosine": motion.cosine[:, part], "sine": motion.sine[:, part]}
    return dataclasses.replace(motion, frequency=motion.frequency[part], **amplitudes, start=None)


def test_one_stage_is_the_sum_of_sines_times_the_window(staged):
    """With and without a start of nought, against the formula."""
    t = jnp.linspace(0, DURATION, 97)
    angle = 2 * np.pi * np.asarray(t)[:, None] * staged.frequency
    shape = np.cos(angle) @ staged.cosine.T + np.sin(angle) @ staged.sine.T
    expected = np.asarray(jax.vmap(window, in_axes=(0, None, None))(t, DURATION, RAMP))[:, None] * shape
    for start in (None, np.zeros(6)):
        one = dataclasses.replace(staged, start=start)
        np.testing.assert_allclose(jax.vmap(one.coordinates)(t), expected, atol=1e-15)


def test_between_the_ramps_only_one_stage_moves(staged):
    np.testing.assert_array_equal(np.unique(staged.end), [4.0, 8.0, 12.0])
    for start, (low, high) in zip(STARTS, ((1.0, 3.0), (4.0, 7.0), (8.0, 11.0)), strict=True):
        t = jnp.linspace(low, high, 31)
        alone = only(staged, start)
        shape = jax.vmap(alone.coordinates)(t)  # its window is one there
        np.testing.assert_allclose(jax.vmap(staged.coordinates)(t), shape, atol=1e-15)


def test_windows_of_neighbours_add_up_to_one():
    """Stages that do the same are one stage, through every cross-fade."""
    t, one = jnp.linspace(0, DURATION, 1201), np.ones(3)
    amplitude = np.linspace(0.1, 0.6, 6)[:, None]
    same = Multisine(0.5 * one, amplitude * one, -amplitude * one, np.array(DURATION), np.array(RAMP), np.array(STARTS))
    whole = Multisine(0.5 * one[:1], amplitude, -amplitude, np.array(DURATION), np.array(RAMP))
    np.testing.assert_allclose(jax.vmap(same.coordinates)(t), jax.vmap(whole.coordinates)(t), atol=1e-14)


def test_rates_are_those_of_the_attitude_through_a_cross_fade(staged):
    """Attitude integrated from omega, and alpha by differences."""
    t = jnp.linspace(0.0, 5.0, 5001)
    turns = jax.vmap(exponential)(jax.vmap(staged.coordinates)(t)[:, 3:])
    np.testing.assert_allclose(attitude(staged, t), turns, atol=1e-9)
    omega, h = jax.vmap(staged.omega), 1e-5
    difference = (omega(t[::50] + h) - omega(t[::50] - h)) / (2 * h)
    np.testing.assert_allclose(jax.vmap(staged.alpha)(t[::50]), difference, atol=1e-7)
    for at in (0.0, DURATION):
        np.testing.assert_allclose(staged.omega(jnp.array(at)), 0, atol=1e-30)


# --- files ---


def written(preset, folder, text, **changes):
    (folder / "amplitudes.csv").write_text(text)
    table = {"kind": "multisine", "amplitudes": "amplitudes.csv", "duration": "12 s", "rate": "100 Hz", "ramp": "1 s"}
    platform = {**preset.document["platform"], "geometry": "assumed-source-size"}
    document = {**preset.document, "platform": platform, "trajectory": {"D": table | changes}}
    return Experiment.from_dict(document, folder)


def test_stages_come_back(preset, tmp_path, staged):
    found = written(preset, tmp_path, multisine_csv(staged)).trajectories["D"].trajectory
    for name in ("frequency", "cosine", "sine", "duration", "ramp", "start"):
        np.testing.assert_array_equal(getattr(found, name), getattr(staged, name))


def rows(*starts, columns=(START, *COLUMNS)):
    lines = [",".join([str(start), "1", *["0.001"] * 12]) for start in starts]
    return "\n".join([",".join(columns), *lines]) + "\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (rows(0, 5, columns=("stage", *COLUMNS)), "names other columns: .*start_s before them"),
        (rows(0, 5, columns=COLUMNS), "not 13 finite numbers"),
        (rows(0, "late"), "not 14 finite numbers"),
        (rows(1, 5), "begins with 1: the first stage starts at 0"),
        (rows(0, 7, 3), "start_s decreases"),
        (rows(0, 7, 7.5), "the stage from 7 s lasts 1.5 s: it has two ramps of 1 s"),
        (rows(0, 10.5), "the stage from 10.5 s lasts 1.5 s"),
        (rows(0, 14), "the stage from 14 s lasts"),
    ],
)
def test_stages_that_cannot_be(preset, tmp_path, text, message):
    with pytest.raises(ExperimentError, match=message) as caught:
        written(preset, tmp_path, text)
    assert "\n" not in str(caught.value)


def test_exports_hold_all_stages(preset, tmp_path, staged):
    """The reader's own check, and a smaller rehearsal of it."""
    experiment = written(preset, tmp_path, multisine_csv(staged))
    spec = experiment.trajectories["D"]
    exported = export_motion(experiment, spec, amplitude=0.5)
    assert exported.seconds == DURATION
    table = np.genfromtxt(exported.contents["motion.csv"].decode().splitlines(), delimiter=",", names=True)
    place = jax.vmap(spec.trajectory.coordinates)(jnp.asarray(table["t_s"]))
    np.testing.assert_allclose(table["x_m"], 0.5 * place[:, 0], atol=2e-9)
    seam = np.abs(table["t_s"] - 3.5) < 0.4
    assert np.abs(table["roll_rad"][seam]).max() > 1e-4


def test_another_duration_keeps_the_shares(preset, tmp_path, staged):
    spec = written(preset, tmp_path, multisine_csv(staged)).trajectories["D"]
    longer = lasting(spec, 23.0).trajectory
    np.testing.assert_allclose(longer.start, 2 * np.asarray(staged.start))
    np.testing.assert_array_equal(np.unique(longer.end), [7.0, 15.0, 23.0])
    np.testing.assert_allclose(scaled(spec, 1.0, 1.0, 24.0).trajectory.start, 2 * np.asarray(staged.start))
    assert shortest(spec) == pytest.approx(1 + 11 / 3)
    with pytest.raises(ExperimentError, match="two ramps of 1 s in each stage"):
        lasting(spec, 4.6)


# --- the search's motion ---


@pytest.fixture(scope="module")
def stages(platform):
    limits = Limits.none()._replace(acceleration=np.full(6, 1.2), speed=np.full(6, 0.128))
    return Stages(Periodic.of(platform, limits, period=1.0, band=2.0, rate=20.0), np.array([0.6, 0.4]))


@pytest.fixture(scope="module")
def platform():
    from uq.document import Table
    from uq.platform_table import parse_geometry

    return jax.tree.map(jnp.asarray, parse_geometry(Table("platform", {"geometry": "assumed-source-size"})))


def test_stages_move_as_their_trajectory(platform, stages, generator):
    """Each stage's period in closed form, against the trajectory between the ramps; and so in the shortened run."""
    unknowns, offset, gravity = 0.2 * generator.normal(size=stages.unknowns), jnp.array([0.01, -0.02, 0.1]), 9.81
    found = stages.moved(platform, jnp.asarray(unknowns), offset, jnp.array(gravity))
    np.testing.assert_allclose(stages.weights.reshape(2, -1).sum(axis=1), stages.share)
    for short, seconds, at in ((False, 21.0, (2, 15)), (True, 7.0, (2, 5))):
        trajectory = stages.multisine(unknowns, 21.0, 1.0, short=short)
        assert float(trajectory.duration) == seconds
        t = jnp.arange(0.0, seconds, 1 / 200)
        whole = platform_motion(platform, trajectory, t, jnp.zeros(3))
        for stage, first in enumerate(at):
            there = jax.tree.map(lambda x, first=first: x[200 * first : 200 * first + 200 : 10], whole)
            ours = jax.tree.map(lambda x, stage=stage: x[20 * stage : 20 * stage + 20], found.platform)
            for one, other in zip(jax.tree.leaves(ours[1:]), jax.tree.leaves(there[1:]), strict=True):
                np.testing.assert_allclose(one, other, atol=1e-7)


def test_a_stage_counts_for_its_share(preset, platform, stages, generator):
    """A weight of two is the same instant twice, in the prediction with all sources."""
    from uq.prediction import Prediction

    prediction = Prediction.of(preset, dataclasses.replace(preset.trajectories["T1"], still="omb"))
    motion = jnp.asarray(generator.normal(size=stages.periodic.unknowns) / 5)
    one = moved(platform, stages.periodic, motion, jnp.zeros(3), jnp.array(9.81))
    n = len(stages.periodic.t)
    order = np.concatenate([np.arange(n), np.arange(7)])
    body = one.body._replace(
        t=one.body.t[order], omega=one.body.omega[:, order], alpha=one.body.alpha[:, order],
        rotation=one.body.rotation[order], specific_force_cg=one.body.specific_force_cg[:, order],
    )  # fmt: skip
    expected = prediction.covariance(body, one.jerk[:, order], 30.0)
    weights = 30.0 * jnp.where(jnp.arange(n) < 7, 2.0, 1.0)
    np.testing.assert_allclose(prediction.covariance(one.body, one.jerk, weights), expected, rtol=1e-9)


# --- patterns ---


@pytest.mark.parametrize("part", [MOMENTS, PRODUCTS])
def test_the_mixture_is_optimal(part, generator):
    """Against another minimiser; and no pattern leads down from it (Kiefer and Wolfowitz)."""
    function, points = average(1e4, NOISE, part), PATTERNS @ generator.normal(size=(6, 3))
    share = optimal_shares(function, points)
    np.testing.assert_allclose(share.sum(), 1)
    steep = np.asarray(steepness(function, jnp.asarray(points), jnp.asarray(share)))
    assert steep.max() <= (1 + 1e-4) * (share @ steep)
    value = jax.jit(jax.value_and_grad(lambda x: function(jnp.einsum("k,ki,kj->ij", x, points, points))))
    other = minimize(
        lambda x: tuple(np.asarray(v, float) for v in value(x)), np.full(32, 1 / 32), jac=True, method="SLSQP",
        bounds=[(0, 1)] * 32, constraints={"type": "eq", "fun": lambda x: x.sum() - 1, "jac": np.ones_like},
        options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    np.testing.assert_allclose(float(value(share)[0]), other.fun, rtol=1e-5)


def test_a_mixture_leaves_out_what_is_small(generator):
    to_alpha = generator.normal(size=(3, 6))
    found = mixture(average(1e4, NOISE, MOMENTS), to_alpha)
    assert 3 <= len(found.share) < 12
    assert (found.share >= 0.02).all()
    assert (np.diff(found.share) <= 0).all()
    np.testing.assert_allclose(found.share.sum(), 1)

"""Motions in stages: files, exports, predictions, and the mixture of patterns behind them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from identify.motion.leg_limits import Limits, platform_motion
from identify.motion.optimal_mixture import mixed, mixture, optimal_shares, patterns, steepness
from identify.motion.periodic_motion import Periodic
from identify.motion.stages import Stages
from identify.motion.trajectory import sample
from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from tests.helpers.multisines import DURATION, staged_multisine
from uq.experiment.experiment import Experiment, ExperimentError
from uq.experiment.multisine_table import COLUMNS, START, multisine_csv
from uq.plan.measurement.required_duration import lasting, shortest
from uq.plan.motion_design.hexapod.design_bound import average_uncertainty
from uq.plan.motion_design.hexapod.motion_export import export_motion
from uq.plan.motion_design.hexapod.reference_trajectory import stretched


@pytest.fixture(scope="module")
def staged():
    return staged_multisine()


NOISE = np.diag([0.2, 0.3, 0.25])


def written(preset, folder, text, **changes):
    (folder / "amplitudes.csv").write_text(text)
    table = {"kind": "multisine", "amplitudes": "amplitudes.csv", "duration": "12 s", "rate": "100 Hz", "ramp": "1 s"}
    platform = {**preset.document["platform"], "geometry": "assumed-source-size"}
    document = {**preset.document, "platform": platform, "trajectory": {"D": table | changes}}
    return Experiment.from_dict(document, folder)


def test_stages_come_back(preset, tmp_path, staged):
    trajectory = written(preset, tmp_path, multisine_csv(staged)).trajectories["D"].trajectory
    for name in ("frequency", "cosine", "sine", "duration", "ramp", "start"):
        np.testing.assert_array_equal(getattr(trajectory, name), getattr(staged, name))


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
        (rows(0, 7, 8.5), "the stage from 7 s lasts 1.5 s: it has two ramps of 1 s"),
        (rows(0, 10.5), "the stage from 10.5 s lasts 1.5 s"),
        (rows(0, 14), "the stage from 14 s lasts"),
    ],
)
def test_stages_that_cannot_be(preset, tmp_path, text, message):
    with pytest.raises(ExperimentError, match=message) as caught:
        written(preset, tmp_path, text)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_exports_hold_all_stages(preset, tmp_path, staged):
    """The reader's own check, and a smaller rehearsal of it."""
    experiment = written(preset, tmp_path, multisine_csv(staged))
    spec = experiment.trajectories["D"]
    exported = export_motion(experiment, spec, amplitude=0.5)
    assert exported.seconds == DURATION
    table = np.genfromtxt(exported.contents["motion.csv"].decode().splitlines(), delimiter=",", names=True)
    place = jax.jit(jax.vmap(spec.trajectory.coordinates))(jnp.asarray(table["t_s"]))
    np.testing.assert_allclose(table["x_m"], 0.5 * place[:, 0], atol=2e-9)
    seam = np.abs(table["t_s"] - 3.5) < 0.4
    assert np.abs(table["roll_rad"][seam]).max() > 1e-4


def test_another_duration_keeps_the_shares(preset, tmp_path, staged):
    spec = written(preset, tmp_path, multisine_csv(staged)).trajectories["D"]
    longer = lasting(spec, 23.0).trajectory
    np.testing.assert_allclose(longer.start, np.repeat([0, 6, 14], 2))  # 5.75 and 13.42 s by shares, periods of 2 s
    assert (longer.duration, longer.ramp) == (23, 1)
    np.testing.assert_allclose(stretched(spec, 24.0).trajectory.start, 2 * np.asarray(staged.start))
    assert shortest(spec) == pytest.approx(2 * 12 / 3)
    with pytest.raises(ExperimentError, match="two ramps of 1 s in each stage"):
        lasting(spec, 7.9)


@pytest.fixture(scope="module")
def stages(platform):
    limits = Limits.none()._replace(acceleration=np.full(6, 1.2), speed=np.full(6, 0.128))
    periodic = Periodic.of(platform, limits, period=1.0, band=2.0, rate=20.0)
    return Stages.of(periodic, np.array([0.6, 0.4]), 21.0, 1.4)


@pytest.fixture(scope="module")
def platform():
    from uq.experiment.platform_table import PlatformTable
    from uq.files.schema import declared_table

    return jax.tree.map(
        jnp.asarray, declared_table("platform", {"geometry": "assumed-source-size"}, PlatformTable).legs
    )


def moved_by(stages, *given):
    """What stages do, as one program; their own numbers are compiled in."""
    return jax.jit(lambda *given: stages.moved(*given))(*given)


def test_stages_move_as_their_trajectory(platform, stages, generator):
    """Pose, specific force and three derivatives, in the ramps too, against the trajectory that a campaign samples."""
    unknowns, offset, gravity = (
        0.2 * generator.normal(size=stages.count * stages.periodic.unknowns),
        jnp.array([0.01, -0.02, 0.1]),
        9.81,
    )
    np.testing.assert_array_equal(stages.border, [0, 13, 21])
    moved = moved_by(stages, platform, jnp.asarray(unknowns), offset, jnp.array(gravity))
    trajectory, t = stages.multisine(unknowns), moved.body.t
    whole = jnp.asarray(np.arange(0.0, 21.0, 1 / 400))
    at = np.round(np.asarray(t) * 400).astype(int)
    np.testing.assert_allclose(np.asarray(whole)[at], t, atol=1e-12)

    @jax.jit
    def sampled(whole, t):
        jerk = jax.vmap(lambda at: jax.jvp(trajectory.alpha, (at,), (jnp.ones_like(at),))[1], out_axes=1)(t)
        body = sample(trajectory, whole, r_cg_from_still=offset, gravity=gravity)
        return platform_motion(platform, trajectory, whole, jnp.zeros(3)), body.specific_force_cg, jerk

    motion, specific_force, jerk = sampled(whole, t)
    motion = jax.tree.map(lambda x: np.asarray(x)[at], motion)
    for ours, theirs in zip(jax.tree.leaves(moved.platform[1:]), jax.tree.leaves(motion[1:]), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-7)
    np.testing.assert_allclose(moved.body.specific_force_cg, np.asarray(specific_force)[:, at], atol=1e-7)
    np.testing.assert_allclose(moved.jerk, jerk, atol=1e-7)


def test_peaks_between_the_instants_are_seen(stages, generator):
    """A sum of five sines on the finer grid, for an odd and an even number of instants; a quintic in the ramps."""
    amplitude, phase = generator.normal(size=(2, 5))
    wave = lambda u: np.sin(2 * np.pi * u[:, None] * np.arange(1, 6) + phase) @ amplitude  # noqa: E731
    for count in (20, 21):
        t = np.arange(count) / count
        other = dataclasses.replace(stages, periodic=dataclasses.replace(stages.periodic, t=t))
        ramp = np.arange(float(len(other.in_ramp))) / 10
        power = generator.normal(size=6)
        samples = [wave(t), np.polyval(power, ramp), np.polyval(power, -ramp)]
        values = jnp.asarray(np.tile(np.concatenate(samples), 2)[:, None])
        finer = np.linspace(0, ramp[-1], 4 * (len(ramp) - 1) + 1)
        samples = [wave(np.arange(4 * count) / (4 * count)), np.polyval(power, finer), np.polyval(power, -finer)]
        expected = np.tile(np.concatenate(samples), 2)
        np.testing.assert_allclose(
            jax.jit(lambda values, other=other: other.finer(values))(values)[:, 0], expected, atol=1e-9
        )


def test_a_shortened_run_has_the_same_peaks(platform, stages, generator):
    unknowns = 0.2 * generator.normal(size=stages.count * stages.periodic.unknowns)
    whole, short = stages.multisine(unknowns), stages.multisine(unknowns, short=True)
    assert float(short.duration) == pytest.approx(4 + 2 * 2.8, abs=1.0)
    largest = [
        np.abs(jax.jit(jax.vmap(motion.omega))(jnp.arange(0, float(motion.duration), 1 / 100))).max(axis=0)
        for motion in (whole, short)
    ]
    np.testing.assert_allclose(*largest, rtol=1e-9)


def test_instants_stand_for_the_whole_run(platform, stages, generator):
    """The mean square of alpha over the run, by 400 samples a second: what is left out next to rest is little."""
    unknowns = 0.2 * generator.normal(size=stages.count * stages.periodic.unknowns)
    moved = moved_by(stages, platform, jnp.asarray(unknowns), jnp.zeros(3), jnp.array(9.81))
    alpha = jax.jit(jax.vmap(stages.multisine(unknowns).alpha))(jnp.arange(0, 21, 1 / 400))
    ours = np.einsum("n,in,jn->ij", stages.seconds, moved.body.alpha, moved.body.alpha)
    theirs = np.einsum("ni,nj->ij", alpha, alpha) / 400
    np.testing.assert_allclose(ours, theirs, atol=2e-2 * np.trace(theirs))


@pytest.mark.slow
def test_weights_are_repeated_instants(preset, stages, platform, generator):
    """A weight of two is the same instant twice, in the prediction with all sources."""
    from uq.analysis.propagation.prediction import Prediction

    prediction = Prediction.of(preset, dataclasses.replace(preset.trajectories["T1"], still="omb"))
    motion = jnp.asarray(generator.normal(size=stages.count * stages.periodic.unknowns) / 5)
    moved = moved_by(stages, platform, motion, jnp.zeros(3), jnp.array(9.81))
    moved = jax.tree.map(np.asarray, moved)
    n = moved.jerk.shape[1]
    order = np.concatenate([np.arange(n), np.arange(7)])
    body = moved.body._replace(
        t=moved.body.t[order], omega=moved.body.omega[:, order], alpha=moved.body.alpha[:, order],
        rotation=moved.body.rotation[order], specific_force_cg=moved.body.specific_force_cg[:, order],
    )  # fmt: skip
    moments = jax.jit(lambda *given: prediction.moments(*given))
    expected = moments(body, moved.jerk[:, order], 98.0, np.full(n + 7, 30.0))
    weights = 30.0 * np.repeat([2.0, 1.0, 0.0], [7, n - 7, 7])  # of the same shape: compiled once
    for got, wanted in zip(moments(body, moved.jerk[:, order], 98.0, weights), expected, strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("part", [MOMENTS, pytest.param(PRODUCTS, marks=pytest.mark.study)])
def test_the_mixture_is_optimal(part, generator):
    """Against another minimiser; and no pattern leads down from it (Kiefer and Wolfowitz)."""
    function, points = (
        average_uncertainty(1e4, NOISE, part),
        generator.choice(patterns(), 40) @ generator.normal(size=(6, 3)),
    )
    share = optimal_shares(function, points)
    np.testing.assert_allclose(share.sum(), 1)
    steep = np.asarray(jax.jit(lambda x: steepness(function, points, x))(share))
    assert steep.max() <= (1 + 2e-3) * (share @ steep)
    value = jax.jit(jax.value_and_grad(lambda x: function(mixed(points, x))))
    whole = np.einsum("k,ki,kj->ij", share, points, points.conj()).real
    np.testing.assert_allclose(jax.jit(lambda x: mixed(points, x))(share), whole, atol=1e-12)
    other = minimize(
        lambda x: tuple(np.asarray(v, float) for v in value(x)), np.full(40, 1 / 40), jac=True, method="SLSQP",
        bounds=[(0, 1)] * 40, constraints={"type": "eq", "fun": lambda x: x.sum() - 1, "jac": np.ones_like},
        options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    np.testing.assert_allclose(float(value(share)[0]), other.fun, rtol=1e-3)


def test_a_mixture_leaves_out_what_is_small_and_runs_both_ways(generator):
    best = mixture(average_uncertainty(1e4, NOISE, MOMENTS), generator.normal(size=(3, 6)))
    assert 1 <= len(best.share) < 10
    np.testing.assert_allclose(best.share.sum(), 1)
    both = best.both_ways()
    np.testing.assert_allclose(both.share.sum(), 1)
    for pattern, share in zip(best.phasors, best.share, strict=True):
        same = np.abs(both.phasors - pattern).max(axis=1) < 1e-9
        other = np.abs(both.phasors - pattern.conj()).max(axis=1) < 1e-9
        assert same.any()
        assert other.any()
        np.testing.assert_allclose(both.share[same | other].sum(), share)

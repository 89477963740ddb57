"""The designed trajectory: its limits on a finer grid of the test's own, its promise, its bound, and bad input.

What needs a whole design is for ``make study``: its gradient alone takes a minute to compile.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.motion.leg_limits import effort, peaks, platform_motion
from tests.helpers.platform_experiment import on_a_platform
from uq.analysis.propagation.prediction import predicted
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.design_goal import GOALS, goal_of, principal_slope
from uq.plan.motion_design.hexapod.design import Design, design
from uq.plan.motion_design.hexapod.design_bound import RELAXED, design_bound
from uq.plan.motion_design.hexapod.design_search import Search, attenuation
from uq.plan.motion_design.hexapod.reference_trajectory import PredictedTrajectory, differentiator, scaled, stretched
from uq.plan.motion_design.hexapod.rig_limits import largest_size, resolved_limits, uses
from uq.plan.motion_design.search import in_pieces


@pytest.fixture(scope="module")
def given(preset):
    return on_a_platform(preset, {"needs_of": "T1", "bandwidth": "3 Hz"})


@pytest.fixture(scope="module")
def searched(given):
    """A small design, and the search inside it, which takes long to compile."""
    reports, made = [], []

    def spy(**given):
        made.append(Search(**given))
        return made[0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("uq.plan.motion_design.hexapod.design_search.Search", spy)
        designed = design(given, starts=1, period=1.0, rounds=5, steps=40, progress=lambda *at: reports.append(at))
    assert {at[0] for at in reports} == {"reference", "starts", "limits"}
    return designed, made[0]


@pytest.fixture(scope="module")
def designed(searched):
    return searched[0]


def test_a_design_shows_its_figures_in_gram():
    shown, shown_reference = object.__new__(Design), object.__new__(PredictedTrajectory)  # without the search
    object.__setattr__(shown, "reference", shown_reference)
    for k, trajectory in enumerate((shown, shown_reference)):
        object.__setattr__(trajectory, "covariance", np.diag(np.full(6, (0.001 * (2 * k + 1) / 3) ** 2)))
        object.__setattr__(trajectory, "mean_error", np.full(6, 0.001 * (2 * k + 2)))
    lines = repr(shown).splitlines()
    assert [line.split("  ")[0] for line in lines[2:]] == [
        "3σ, designed", "mean error, designed", "3σ, reference", "mean error, reference",
    ]  # fmt: skip
    assert [line.split()[-1] for line in lines[2:]] == ["1.00", "2.00", "3.00", "4.00"]


@pytest.mark.study
def test_no_limit_is_exceeded_at_any_instant(given, designed):
    """On a grid of 3,000 Hz over the whole run with its ramps, which no part of the search has seen."""
    t = jnp.linspace(0, 20, 60_001)
    motion = platform_motion(given.platform, designed.spec.trajectory, t, jnp.zeros(3))
    asked = effort(given.platform, given.body, jnp.asarray(given.r_cg_from_omb), motion, jnp.asarray(given.gravity))
    worst = peaks(asked, designed.limits, t)[0]
    assert worst.share < 1 + 1e-4
    assert worst.share > 0.97  # and one of them is used
    assert designed.active
    assert designed.peaks[0].share <= 1


@pytest.mark.study
def test_it_starts_and_ends_at_rest_at_home(designed):
    trajectory = designed.spec.trajectory
    for t in (0.0, 20.0):
        np.testing.assert_allclose(trajectory.coordinates(jnp.array(t)), 0, atol=1e-30)
        np.testing.assert_allclose(trajectory.omega(jnp.array(t)), 0, atol=1e-30)


@pytest.mark.study
def test_it_beats_the_reference_and_not_the_bound(designed):
    assert isinstance(designed, Design)
    assert designed.improved
    for components, least in (([0, 3, 5], designed.bound.moments), ([1, 2, 4], designed.bound.products)):
        assert least < designed.expanded[components].mean() < designed.reference.expanded[components].mean()
    assert designed.bound.relaxes == RELAXED
    assert designed.spec.trajectory.highest_frequency <= designed.band <= 3.0


@pytest.mark.study
def test_the_promise_is_the_laws(designed):
    from uq import law

    matched = {"trajectories": {"designed": designed.spec}, "estimators": (differentiator(designed.band),)}
    experiment = dataclasses.replace(designed.experiment, **matched)
    total = law(experiment, "designed", "designed")["designed", "designed"].groups["total"]
    np.testing.assert_allclose(designed.expanded, 3 * np.sqrt(np.diag(total.covariance)), rtol=0.03)
    off = 4e-5 + 0.02 * np.abs(total.mean_error).max()  # the differentiator is right to 1e-4
    np.testing.assert_allclose(designed.mean_error, total.mean_error, rtol=0, atol=off)


@pytest.mark.study
def test_a_gradient_is_that_of_differences(searched, generator):
    """Of goal and limits together, along a random direction."""
    search = searched[1]
    x, along = 0.3 * generator.normal(size=(2, search.stages.count * search.stages.periodic.unknowns))
    multipliers = np.full(jax.eval_shape(search.lagrangian.goal, x)[1].shape, 0.2)
    value = lambda h: search.lagrangian.at(x + h * along, multipliers, 30.0)[0]  # noqa: E731
    slope = search.lagrangian.at(x, multipliers, 30.0)[1] @ along
    np.testing.assert_allclose(slope, (value(1e-5) - value(-1e-5)) / 2e-5, rtol=1e-5)


@pytest.mark.study
def test_the_design_in_the_docs_is_what_they_say():
    """uq/examples/designed.toml: limits at 800 Hz over the whole run, average 3σ of docs/explanation/design.md, the bounds."""
    experiment = Experiment.load("uq/examples/designed.toml")
    limits, figures = resolved_limits(experiment, 160), {"designed": (1.795, 1.265), "T1_at_its_best": (2.627, 1.795)}
    for name, expected in figures.items():
        spec = experiment.trajectories[name]
        assert uses(experiment, spec, limits, 800.0)[0].share <= 1 + 1e-8
        three = 3e3 * np.sqrt(np.diag(predicted(experiment, spec, 50.0, 0.0)[1]))
        np.testing.assert_allclose([three[[0, 3, 5]].mean(), three[[1, 2, 4]].mean()], expected, atol=6e-4)
    least = design_bound(experiment, experiment.trajectories["T1"], limits)
    np.testing.assert_allclose([1e3 * least.moments, 1e3 * least.products], [1.460, 1.008], atol=6e-4)


# --- limits and reference ---


def test_limits_are_the_needs_where_none_are_declared(preset, given):
    needed = resolved_limits(given, 100)
    stated = on_a_platform(preset, {"needs_of": "T1", "bandwidth": "3 Hz", "speed": "0.05 m/s"})
    mixed = resolved_limits(stated, 100)
    np.testing.assert_array_equal(mixed.speed, 0.05)
    np.testing.assert_array_equal(mixed.acceleration, needed.acceleration)
    listed = uses(given, given.trajectories["T1"], needed, 300.0)
    np.testing.assert_allclose([peak.share for peak in listed], 1, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 149, 150, 401])
def test_pieces_are_put_together(count, generator):
    motion = {"pose": generator.normal(size=(count, 3, 3)), "t": np.arange(float(count))}
    sizes = []

    def function(piece):
        sizes.append(len(piece["t"]))
        return {"turned": np.asarray(piece["pose"])[:, ::-1], "late": 2 * np.asarray(piece["t"])}

    found = in_pieces(function, motion, 150)
    np.testing.assert_array_equal(found["turned"], motion["pose"][:, ::-1])
    np.testing.assert_array_equal(found["late"], 2 * motion["t"])
    assert set(sizes) == {150}


def test_the_largest_size_just_meets_the_limits(given):
    spec, limits = given.trajectories["T1"], resolved_limits(given, 20)
    half = limits._replace(speed=limits.speed / 2)
    size = largest_size(given, lambda size: scaled(spec, size, 1.0), half, 60.0)
    worst = uses(given, scaled(spec, size, 1.0), half, 60.0)[0]
    assert worst.quantity == "speed"
    assert 0.998 < worst.share <= 1 + 1e-9


def test_a_scaled_trajectory_is_faster_and_smaller(given):
    spec = given.trajectories["T1"]
    faster = scaled(spec, 0.25, 2.0)
    assert faster.trajectory.highest_frequency == pytest.approx(
        2 * spec.trajectory.highest_frequency - 2 / 20, rel=1e-12
    )
    np.testing.assert_allclose(faster.trajectory.angular_acceleration, spec.trajectory.angular_acceleration)
    assert stretched(spec, 40.0).duration == 40.0


# --- goals ---


@pytest.mark.parametrize("name", GOALS)
def test_goals_fall_with_the_covariance(name):
    inertia, covariance = np.array([0.38, 0.01, 0.0, 0.02, 0.0, 0.3]), np.diag(np.arange(1.0, 7.0))
    measure = goal_of(name, inertia, covariance, np.zeros(6), "3sigma")
    at = lambda covariance: float(measure(jnp.asarray(covariance), jnp.ones(6)))  # noqa: E731
    assert at(covariance / 4) == pytest.approx(at(covariance) / 2)
    if name != "worst":
        assert at(covariance) == pytest.approx(1.0)


@pytest.mark.parametrize("name", GOALS)
def test_the_mean_error_counts_as_a_standard_deviation_of_its_size(name, generator):
    """Of a principal moment, too: E[(s·e)²] of its slope s, whatever the errors e; 10,000 of them, with their own mean."""
    inertia = np.array([0.38, 0.01, 0.0, 0.02, 0.0, 0.3])
    errors = generator.normal(size=(10_000, 6)) * np.arange(1.0, 7.0) + np.array([3.0, -1.0, 0.0, 2.0, 1.0, -8.0])
    covariance, mean = jnp.asarray(np.cov(errors.T, bias=True)), jnp.asarray(errors.mean(axis=0))
    rms = 3 * np.sqrt((errors**2).mean(axis=0))
    if name.startswith("axis"):
        expected = np.sqrt(((errors @ principal_slope(inertia, int(name[-1]) - 1)) ** 2).mean())
    elif name == "worst":
        expected = rms.max() * ((rms / rms.max()) ** 8).mean() ** (1 / 8)
    else:
        groups = {"moments": [[0, 3, 5]], "products": [[1, 2, 4]]}.get(name, [[0, 3, 5], [1, 2, 4]])
        expected = (np.array([rms[group].mean() for group in groups]) ** 8).mean() ** (1 / 8)
    unit = goal_of(name, inertia, np.eye(6), np.zeros(6))  # every 3σ is 3, that of a principal moment |its slope|
    scale = {"axis": 0.0, "worst": 3.0}.get(name.split()[0], 3.0)
    scale = scale or np.linalg.norm(principal_slope(inertia, int(name[-1]) - 1))
    assert float(unit(covariance, mean)) * scale == pytest.approx(expected, rel=1e-9)


def test_noise_attenuates_the_tensor(generator):
    """Least squares on noisy alpha: 400,000 samples, each component within five standard errors of E[-(A + N)⁻¹ N i]."""
    inertia, n = np.array([0.38, 0.01, 0.0, 0.02, 0.0, 0.3]), 400_000
    moment, noise = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]]), np.diag([0.1, 0.2, 0.6])
    true = generator.normal(size=(n, 3)) @ np.linalg.cholesky(moment).T
    seen = true + generator.normal(size=(n, 3)) * np.sqrt(np.diag(noise))
    packed = lambda a: np.stack([  # noqa: E731
        np.stack([a[:, 0], a[:, 1], a[:, 2], 0 * a[:, 0], 0 * a[:, 0], 0 * a[:, 0]], axis=1),
        np.stack([0 * a[:, 0], a[:, 0], 0 * a[:, 0], a[:, 1], a[:, 2], 0 * a[:, 0]], axis=1),
        np.stack([0 * a[:, 0], 0 * a[:, 0], a[:, 0], 0 * a[:, 0], a[:, 1], a[:, 2]], axis=1),
    ], axis=1).reshape(-1, 6)  # fmt: skip
    rows = packed(seen)
    estimate, residual, *_ = np.linalg.lstsq(rows, packed(true) @ inertia, rcond=None)
    error = np.sqrt(residual[0] / len(rows) * np.diag(np.linalg.inv(rows.T @ rows)))
    got = np.asarray(attenuation(inertia, noise)(jnp.asarray(moment)))
    assert np.abs(got).max() > 100 * error.max()
    assert (np.abs(got - (estimate - inertia)) < 5 * error + 0.01 * np.abs(got)).all()


def test_slope_of_a_principal_moment(generator):
    inertia, step = np.array([0.38, 0.01, -0.02, 0.02, 0.03, 0.3]), 1e-6 * generator.normal(size=6)
    from identify.rigid_body.principal_axes import principal

    change = principal(jnp.asarray(inertia + step))[0] - principal(jnp.asarray(inertia - step))[0]
    for axis in range(3):
        np.testing.assert_allclose(principal_slope(inertia, axis) @ step * 2, change[axis], rtol=1e-4)


# --- bad input ---


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"needs_of": "T1"}, "platform.limits.bandwidth"),
        ({"bandwidth": "3 Hz", "speed": "1 m/s"}, "platform.limits.length or speed"),
        ({"needs_of": "T9", "bandwidth": "3 Hz"}, "unknown trajectory 'T9'"),
        (
            {"bandwidth": "3 Hz", "length": ["0.5 m", "0.7 m"], "speed": "1 m/s", "force": "60 N"},
            r"force of leg \d at 0.000 s: 1\d\d.\d % of its limit at rest at home",
        ),
        (
            {"bandwidth": "3 Hz", "length": ["0.6 m", "0.7 m"], "speed": "1 m/s"},
            r"platform.limits.length is 0.6 to 0.7 m, but leg \d of platform.geometry is 0.5\d\d m long at home",
        ),
    ],
)
def test_limits_that_cannot_be(preset, limits, message):
    with pytest.raises(ExperimentError, match=message):
        design(on_a_platform(preset, limits))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": "best"}, "unknown goal 'best'"),
        ({"objective": "mse"}, "unknown objective 'mse': choose one of rms, 3sigma"),
        ({"reference": "T7"}, "unknown trajectory 'T7'"),
        ({"starts": 0}, "0 starts"),
        ({"period": -1.0}, "a period of -1 s"),
        ({"duration": float("nan")}, "a duration of nan s"),
        ({"period": 6.0}, "a run of 20 s: motions of period 6 s take 24 s or more"),
    ],
)
def test_bad_options(given, options, message):
    with pytest.raises(ExperimentError, match=message):
        design(given, **options)


def test_without_limits(preset, given):
    with pytest.raises(ExperimentError, match=r"missing table \[platform.limits\]"):
        design(dataclasses.replace(given, limits=None))


def test_without_noise_there_is_no_bound(given):
    quiet = dataclasses.replace(given, sources=tuple(s for s in given.sources if s.target == "omega"))
    assert design_bound(quiet, quiet.trajectories["T1"], resolved_limits(given, 20)) is None

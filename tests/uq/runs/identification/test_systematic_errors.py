"""Declared systematic sources of a recorded run: against rigs that have these errors, and against the linear law."""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.identification import identify
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Rest, RunError
from tests.helpers.recordings import silenced
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification import systematic_errors
from uq.runs.identification.systematic_errors import (
    IN_THE_WRENCH,
    draws,
    estimate,
    problem_of,
    propagated,
    with_declared_sources,
)
from uq.sources.constant_errors import errors_of
from uq.sources.distributions import Normal
from uq.sources.source import Source

pytestmark = pytest.mark.usefixtures("unjudged")
DOCS = Path(__file__).parents[4] / "uq" / "examples"
SCALE = Source("M_gain", "M", "scale", "load_cell", np.full(3, 0.01))


def only(experiment, *sources):
    return dataclasses.replace(experiment, sources=sources, mixing=())


@pytest.fixture(scope="module")
def constant():
    """An experiment with one of every constant error that a recorded run does not hold already."""
    experiment = Experiment.load(DOCS / "many-errors.toml")
    return only(experiment, *(s for s in experiment.sources if s.constant and s.perturbs not in IN_THE_WRENCH))


@pytest.fixture(scope="module")
def few(constant):
    """Of these: a gain, turned axes, a delay, the centre of gravity."""
    names = ("M_scale", "gyro_misalignment", "delay", "r_cg")
    return only(constant, *(s for s in constant.sources if s.name in names))


@pytest.fixture(scope="module")
def silent(constant):
    return simulate(only(constant)).run


def identified(experiment, run, offsets, r_cg=None, estimator=None):
    return identify(
        run,
        r_cg=experiment.r_cg_from_q if r_cg is None else r_cg,
        sigma_r_cg=experiment.sigma_r_cg,
        estimator=estimator or experiment.estimator("smoothed"),
        offsets=offsets,
    )


@eqx.filter_jit
def with_draw(problem, drawn):
    return estimate(problem, [errors_of(problem.sources, drawn)])


@pytest.mark.parametrize("offsets", ["estimate", pytest.param("none", marks=pytest.mark.study)])
def test_errors_are_those_of_a_rig_that_has_them(constant, silent, offsets):
    """The draw of a trial, put into the sensors and the air of a simulated run, and that run identified.

    Signals, elements and sums are other code: only rounding, the delay's polynomial and the spline lie between, and
    that a silent run's attitude is taken from its force.
    """
    exact = identified(constant, silent, offsets)
    problem = problem_of(exact, [silent], constant)
    assert len(problem.sources) == 14  # all but r_CG, of which the result knows
    drawn = draws(problem, jax.random.key(3), 0)
    own = with_draw(problem, drawn[0]) - exact.inertia
    rig = simulate(constant, seed=3).run
    direct = identified(constant, rig, offsets).inertia
    np.testing.assert_allclose(own, direct - exact.inertia, atol=1e-5 * np.abs(direct - exact.inertia).max())


@pytest.mark.parametrize(
    "which", [pytest.param("few", marks=pytest.mark.slow), pytest.param("constant", marks=pytest.mark.study)]
)
def test_each_source_disperses_as_its_derivatives_say(which, silent, request):
    """GUM 5.1.2 by jax.jacfwd, source by source; 10,000 draws of normal sources know σ to 0.7 %, tolerance 4 times it.

    Rectangular sources' to less. Together they add in squares: a second order is beyond these small errors.
    """
    experiment = request.getfixturevalue(which)
    exact = identified(experiment, silent, "none")
    problem = problem_of(exact, [silent], experiment)
    found = propagated(problem_of(exact, [silent], experiment))
    means = {s.name: jnp.broadcast_to(jnp.asarray(s.mean, float), np.shape(s.sigma)) for s in problem.sources}
    slopes = jax.jacfwd(lambda of: with_draw(problem, of))(means)
    variances, together = [], sum(found.alone.values()).std(axis=0)
    for source in problem.sources:
        slope = np.asarray(slopes[source.name]).reshape(6, -1)
        matrix = np.diag(np.square(source.standard_deviation).reshape(-1))
        of_source = np.diag(slope @ matrix @ slope.T)
        spread = found.alone[source.name].std(axis=0)
        # what a source leaves of a component at second order only is far below what the others do to it
        np.testing.assert_allclose(spread, np.sqrt(of_source), rtol=0.03, atol=3e-3 * together.max())
        variances.append(of_source)
    np.testing.assert_allclose(together, np.sqrt(np.sum(variances, axis=0)), rtol=0.03)


def test_the_centre_of_gravity_is_counted_once(short):
    """Its part of a result's covariance is the derivative's, before and after."""
    experiment = only(short, *(s for s in short.sources if s.target == "r_cg"))
    run = simulate(silenced(short), "T2").run
    before = identified(experiment, run, "estimate", estimator=short.estimator("smoothed"))
    after = with_declared_sources(before, [run], experiment)
    known = before.diagnostics["standard_uncertainty_from_cg"]
    np.testing.assert_allclose(after.contributions["r_cg"], known, rtol=1e-9, atol=1e-9 * np.max(known))
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(after.interval95, before.interval95, rtol=1e-9)


@pytest.mark.parametrize(
    "estimator", [pytest.param("smoothed", marks=pytest.mark.study), EstimatorSpec("filtered", "central", lowpass=4.0)]
)
def test_behind_a_filter_and_from_rest_a_gain_acts_as_on_the_samples(short, estimator):
    """Samples and rest of a run multiplied by hand, against the sums: a gain of the load cell and one of the gyro."""
    spec = short.estimator(estimator) if isinstance(estimator, str) else estimator
    run = simulate(silenced(short), "T1").run
    force = np.array([3.0, -1, 195])
    rest = Rest(force, np.cross(short.r_cg_from_q, force), np.zeros((6, 6)), 4.0)
    run = dataclasses.replace(run, rest=rest)
    gyro = Source("gyro_gain", "omega", "scale", "imu", np.full(3, 0.01))
    experiment = only(short, SCALE, gyro)
    exact = identified(experiment, run, "still", estimator=spec)
    problem = problem_of(exact, [run], experiment)
    cell, turn = np.array([0.01, -0.02, 0.005]), np.array([0.01, 0.03, -0.02])
    own = with_draw(problem, {"M_gain": jnp.asarray(cell), "gyro_gain": jnp.asarray(turn)})
    spoiled = dataclasses.replace(
        run, moment=(1 + cell) * run.moment, omega=(1 + turn) * run.omega,
        rest=dataclasses.replace(rest, moment=(1 + cell) * rest.moment),
    )  # fmt: skip
    change = identified(experiment, spoiled, "still", estimator=spec).inertia - exact.inertia
    np.testing.assert_allclose(own - exact.inertia, change, atol=1e-3 * np.abs(change).max())


def test_an_expected_error_is_stated_and_in_the_interval(short):
    """A gain that is 3 % too high by declaration: the estimate stays, its bias says so, the interval holds the truth."""
    known = dataclasses.replace(SCALE, mean=np.full(3, 0.03), sigma=np.full(3, 0.001), shape=Normal(0.0, 1.0))
    experiment = only(short, known)
    run = simulate(silenced(short), "T1").run
    run = dataclasses.replace(run, moment=1.03 * run.moment)
    result = identified(experiment, run, "estimate", estimator=short.estimator("smoothed"))
    wide = with_declared_sources(result, [run], experiment)
    np.testing.assert_array_equal(wide.inertia, result.inertia)
    # the gain multiplies r × F, too; the square of 3 % is left
    np.testing.assert_allclose(wide.inertia - wide.bias, short.inertia, atol=2e-3 * short.inertia.max())
    low, high = wide.interval95.T
    assert ((low < short.inertia) & (short.inertia < high))[[0, 3, 5]].all()
    assert not (low[0] < result.inertia[0] < high[0])
    # an estimator that evaluates its own noise: the same sources on top of its covariance
    other = with_declared_sources(dataclasses.replace(result, pooling=None), [run], experiment)
    np.testing.assert_allclose(np.diag(other.covariance), np.diag(wide.covariance), rtol=1e-6)
    np.testing.assert_allclose(other.interval95, wide.interval95, atol=0.1 * wide.standard_uncertainty.max())
    assert 1 < wide.to_dict()["budget"]["M_gain"]["I11"] / (1e-3 * short.inertia[0]) < 2


@pytest.mark.parametrize("sigma", [pytest.param(0.0, marks=pytest.mark.study), 1e-3])
@pytest.mark.slow  # an expected gain: above
def test_an_expected_delay_is_a_bias_however_well_it_is_known(short, sigma):
    """Of 20 ms, eight samples: the angular velocity of earlier ones, identified, against the mean of the draws."""
    late = Source("late", "omega", "delay", "imu", np.array(sigma), mean=np.array(0.02))
    run = simulate(silenced(short), "T1").run
    inner = {name: getattr(run, name)[8:] for name in ("t", "force", "moment")}
    prompt, delayed = (dataclasses.replace(run, **inner, omega=omega) for omega in (run.omega[8:], run.omega[:-8]))
    result, other = (
        identified(short, each, "none", estimator=short.estimator("smoothed")) for each in (prompt, delayed)
    )
    wide = with_declared_sources(result, [prompt], only(short, late))
    change = other.inertia - result.inertia
    np.testing.assert_allclose(wide.bias - result.bias, change, atol=0.02 * np.abs(change).max())


def test_a_delay_that_takes_the_run_is_refused(short):
    late = Source("late", "omega", "delay", "imu", np.array(2.0))
    run = simulate(silenced(short), "T1").run
    result = identified(short, run, "estimate", estimator=short.estimator("smoothed"))
    with pytest.raises(RunError, match="takes more than half of simulated T1: record for longer, or declare"):
        with_declared_sources(result, [run], only(short, late))


def test_what_no_mounting_can_draw_anew_is_refused(constant, silent):
    result = identified(constant, silent, "none")
    with pytest.raises(ExperimentError, match="drawn_by_mounting names 'glue': name sources that are drawn once"):
        with_declared_sources(result, [silent], constant, redrawn=["glue"])
    whole = Experiment.load(DOCS / "many-errors.toml")
    linked = whole.mixing[0].names
    if len(linked) > 1:
        with pytest.raises(ExperimentError, match=f"'{linked[0]}' without what it is correlated with: name all of"):
            with_declared_sources(result, [silent], whole, redrawn=[linked[0]])


@pytest.mark.parametrize(
    ("runs", "trials"), [pytest.param(8, 500, marks=pytest.mark.slow), pytest.param(300, 2000, marks=pytest.mark.study)]
)
def test_intervals_cover_with_noise_and_constant_errors(constant, few, runs, trials):
    """Rigs with these errors (all of them in the study) and noise, identified without knowing them but by declaration.

    Of 8 runs the binomial standard error is at most 7.7 %, were the components fully correlated, 3.1 % were they
    independent: 0.75 is 2.6 of the larger. Of 300 it is at most 1.3 %, and 0.915 and 0.985 are 2.7 of it off.
    """
    rng, covered, constant = np.random.default_rng(3), [], few if runs == 8 else constant
    for trial in range(runs):
        run = simulate(constant, seed=8, trial=trial).run
        moment = run.moment + 0.2 * rng.standard_normal(run.moment.shape)
        believed = constant.r_cg_from_q + constant.sigma_r_cg * rng.standard_normal(3)
        result = identified(constant, dataclasses.replace(run, moment=moment), "estimate", believed)
        low, high = with_declared_sources(result, [run], constant, trials=trials).interval95.T
        covered.append((low <= constant.inertia) & (constant.inertia <= high))
    print(np.mean(covered, axis=0), np.mean(covered))
    assert (0.75 if runs == 8 else 0.915) < np.mean(covered) <= (1.0 if runs == 8 else 0.985)


def test_draws_without_a_solution_are_counted_and_left_out(short, monkeypatch):
    """Where every tenth trial's estimate is NaN, what the others say is stated, with a warning; most of them say nothing."""
    experiment = only(short, SCALE)
    run = simulate(silenced(short), "T2").run
    before = identified(experiment, run, "estimate", estimator=short.estimator("smoothed"))

    def some_fail(*arguments, **options):
        trials = np.array(loop(*arguments, **options))
        trials[::step] = np.nan
        return trials

    loop, step = systematic_errors.all_trials, 10
    monkeypatch.setattr(systematic_errors, "all_trials", some_fail)
    after = with_declared_sources(before, [run], experiment, trials=1000)
    assert "100 of 1,000 draws of the declared sources leave no solution: they are left out" in after.warnings
    assert np.isfinite(after.interval95).all()
    assert (after.contributions["M_gain"] > 0).any()
    step = 1
    with pytest.raises(RunError, match="1,000 of 1,000 draws of the declared sources leave no solution: state smaller"):
        with_declared_sources(before, [run], experiment, trials=1000)

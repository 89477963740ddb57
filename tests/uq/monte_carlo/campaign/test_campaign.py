"""The Monte Carlo: exact without errors, closed forms, the same numbers however it is batched, by either engine."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.floating_point import PrecisionWarning
from identify.identification import identify
from identify.least_squares.gram import solve
from identify.rigid_body.inertia import GRAM_METRE
from identify.rigid_body.regressor import omega_r
from identify.signals.differentiate import gain
from tests.helpers.gram_lab import accumulate
from tests.helpers.small_campaign import TRIALS
from tests.helpers.source_lab import draw_block
from uq.experiment.experiment import ExperimentError
from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo
from uq.monte_carlo.campaign.simulation import simulate
from uq.monte_carlo.campaign.statistics import Statistics
from uq.monte_carlo.campaign.trial_setup import prepare_engine, true_motion, true_motions
from uq.monte_carlo.trials import trial_loop
from uq.report.tables.campaign import shares as share_table
from uq.sources.draws import draw_constants


def only(experiment, *names):
    return dataclasses.replace(experiment, sources=tuple(s for s in experiment.sources if s.name in names))


BOTH = ("central", "smoothed")


def estimates(experiment, trials, *, name="T1", estimators=("central",), devices=None, batch=None, **options):
    """On one device at least a hundred trials are run, on sums 500: any number of them is one compiled program."""
    chosen = [experiment.estimator(e) for e in estimators]
    engine, _ = prepare_engine(experiment, experiment.trajectories[name], chosen, **options)
    least = 100 if options.get("engine") == "samples" else 500
    enough = max(trials, least) if experiment.sources and devices is None else trials
    loop = engine.loop(0, devices=devices or jax.devices()[:1], batch=batch, segment=100)
    loop.reach(enough)
    return engine, loop.results(trials)


def errors(experiment, trials, **options):
    return estimates(experiment, trials, **options)[1] - np.asarray(experiment.inertia)


# --- no errors ---


@pytest.mark.parametrize("name", ["T1", "T2", "T3", "T4"])
def test_without_errors_analytic_alpha_gives_the_exact_tensor(preset, name):
    spec = preset.trajectories[name]
    run = simulate(only(preset), name).run
    motion = true_motion(preset, spec)
    sums = accumulate(motion.omega, motion.alpha, jnp.asarray(run.force.T), jnp.asarray(run.moment.T))
    estimate = jax.jit(solve)(sums, jnp.asarray(preset.r_cg_from_q))
    np.testing.assert_allclose(estimate.inertia, preset.inertia, atol=1e-9 * preset.inertia.max())


@pytest.mark.parametrize("name", [pytest.param("T1", marks=pytest.mark.slow), "T4"])
def test_without_errors_each_differentiator_errs_as_its_gain_predicts(preset, name):
    """A gain g at the motion's frequency scales alpha, so every moment comes out as I/g."""
    error = errors(only(preset), 1, name=name, estimators=BOTH)[0, :, 0]
    frequency = np.array([4 / 0.425 / (2 * np.pi)])
    for k, estimator in enumerate(BOTH):
        g = gain(preset.estimator(estimator).taps(400.0), 400.0, frequency)[0]
        relative = error[k, [0, 3, 5]] / preset.inertia[[0, 3, 5]]
        np.testing.assert_allclose(relative, 1 / g - 1, rtol=0.05)
        if estimator == "central":
            np.testing.assert_allclose(relative, (4 / 0.425 / 400) ** 2 / 6, rtol=0.05)  # 9.2e-5
        assert np.abs(error[k, [1, 2, 4]]).max() < 2e-6 * preset.inertia.max()


def test_motions_computed_together_are_those_computed_alone(brief):
    """T2 and T4 are T1 and T3 about another point; the order in which they come does not matter."""
    for order in (("T1", "T2", "T3", "T4"), ("T4", "T2", "T3", "T1")):
        found = true_motions(brief, {name: brief.trajectories[name] for name in order})
        for name in order:
            for together, alone in zip(found[name], true_motion(brief, brief.trajectories[name]), strict=True):
                np.testing.assert_allclose(together, alone, rtol=1e-13, atol=1e-13)
        assert found["T1"].rotation is found["T2"].rotation
        assert np.abs(found["T3"].specific_force_cg - found["T4"].specific_force_cg).max() > 1e-2


# --- closed forms ---


ENGINES = pytest.mark.parametrize("engine", ["sums", pytest.param("samples", marks=pytest.mark.study)])


@ENGINES
def test_load_cell_and_cg_variances_are_the_closed_form(brief, engine):
    """With the true omega the estimate is linear in F, M and r: variance (ΩᵀΩ)⁻¹ Ωᵀ Σ Ω (ΩᵀΩ)⁻¹."""
    trials = 500
    prepared, result = estimates(brief, trials, estimators=("central",), engine=engine)
    without = estimates(only(brief), 1, estimators=("central",))[1][0, 0, 0]
    motion = true_motion(brief, brief.trajectories["T1"])
    alpha = (motion.omega[:, 2:] - motion.omega[:, :-2]) * 200
    rows = np.asarray(jax.jit(jax.vmap(omega_r, in_axes=1))(motion.omega[:, 1:-1], alpha))
    inverse = np.linalg.inv(np.einsum("nji,nje->ie", rows, rows))
    r, force = brief.r_cg_from_q, np.asarray(simulate(only(brief)).run.force)[1:-1]
    moment_of_force = np.array([[0, r[2], -r[1]], [-r[2], 0, r[0]], [r[1], -r[0], 0]])  # d(-r×F)/dF
    sigma = {source.name: source.sigma for source in brief.sources}
    closed = {
        "M_precision": np.einsum("nji,j,nje->ie", rows, sigma["M_precision"] ** 2, rows),
        "F_precision": np.einsum(
            "nji,jf,f,kf,nke->ie", rows, moment_of_force, sigma["F_precision"] ** 2, moment_of_force, rows, optimize=True
        ),
        "M_bias": (one := rows.sum(0).T) @ np.diag(sigma["M_bias"] ** 2) @ one.T,
        "F_bias": (two := one @ moment_of_force) @ np.diag(sigma["F_bias"] ** 2) @ two.T,
        "r_cg": (
            three := np.einsum("nji,njr->ir", rows, np.stack([np.cross(f, np.eye(3)).T for f in force]))
        ) @ np.diag(sigma["r_cg"] ** 2) @ three.T,
    }  # fmt: skip
    for k, case in enumerate(prepared.cases):
        name = case.name.removeprefix("source:")
        if name in closed:
            variance = np.diag(inverse @ closed[name] @ inverse)
            measured = result[:, 0, k].var(0, ddof=1)
            # normal: standard error √(2/(N-1)); 30 comparisons at 4 standard errors: 0.2 % false alarms
            np.testing.assert_allclose(measured, variance, rtol=4 * np.sqrt(2 / (trials - 1)), atol=1e-25, err_msg=name)
            mean = result[:, 0, k].mean(0)
            np.testing.assert_array_less(np.abs(mean - without), 4 * np.sqrt(variance / trials) + 1e-12)


@pytest.mark.study
def test_both_engines_have_the_same_distribution(brief):
    """Either against the reference trial: ``trials/test_reference_trial.py``."""
    trials = 600
    one, two = (errors(brief, trials, name="T3", estimators=BOTH, engine=e) for e in ("sums", "samples"))
    first, second = one.std(0, ddof=1), two.std(0, ddof=1)
    # 2 estimators x 11 cases x 6: relative standard error of the ratio 1/√N; 5 of them: 1e-4 false alarms
    np.testing.assert_allclose(first, second, rtol=5 / np.sqrt(trials), atol=1e-12)
    spread = np.sqrt((first**2 + second**2) / trials)
    assert (np.abs(one.mean(0) - two.mean(0)) <= 5 * spread + 1e-12).all()
    # the estimators of one trial share their draws: they agree far better than they scatter
    shared = np.std(one[:, 0, 0] - one[:, 1, 0], axis=0) / first[0, 0]
    np.testing.assert_allclose(shared, np.std(two[:, 0, 0] - two[:, 1, 0], axis=0) / second[0, 0], rtol=0.2)


def test_groups_share_their_draws(brief):
    """In the linear regime the total is the sum of the sources: common random numbers make it hold trial by trial."""
    tiny = dataclasses.replace(
        brief, sources=tuple(eqx.tree_at(lambda s: s.sigma, s, 1e-4 * s.sigma) for s in brief.sources)
    )
    engine, result = estimates(tiny, 8)
    error = result - np.asarray(errors(only(brief), 1))[0, :, :1][None] - np.asarray(brief.inertia)
    position = {case.name: k for k, case in enumerate(engine.cases)}
    groups = sum(error[:, :, k] for name, k in position.items() if name.startswith("group:"))
    sources = sum(error[:, :, k] for name, k in position.items() if name.startswith("source:"))
    scale = np.abs(error[:, :, 0]).max()
    np.testing.assert_allclose(groups, error[:, :, 0], atol=1e-3 * scale)
    np.testing.assert_allclose(sources, error[:, :, 0], atol=1e-3 * scale)


# --- the same functions, the same numbers ---


def drawn_constants(experiment, trial):
    """What is drawn once in a trial of seed 0."""
    return draw_constants(experiment.sources, (), jax.random.key(0), jnp.asarray(trial), jnp.dtype(float))


def plain(found):
    """Least squares alone, where a brief run's tensor was moved to one that a body can have."""
    return found.inertia if found.admissible is None else found.admissible.plain


@pytest.mark.parametrize(
    "estimator", [pytest.param("central", marks=pytest.mark.slow), pytest.param("smoothed", marks=pytest.mark.study)]
)
def test_a_simulated_run_is_identified_as_its_trial_was(brief, estimator):
    """A recorded run and a trial of the Monte Carlo pass through the same mathematics. With fewer sources below."""
    one = dataclasses.replace(brief, estimators=(brief.estimator(estimator),))
    _, result = estimates(one, 4, estimators=(estimator,), engine="samples")
    found = identify(
        simulate(one, "T1", seed=0, trial=3).run,
        r_cg=np.asarray(brief.r_cg_from_q + drawn_constants(brief, 3)["r_cg"]),
        estimator=one.estimators[0],
        offsets="none",
    )
    np.testing.assert_allclose(plain(found), result[3, 0, 0], atol=1e-12 * brief.inertia.max())


@pytest.mark.parametrize(
    ("engine", "dtype", "tolerance"),
    [
        pytest.param("samples", "float64", 1e-12, marks=pytest.mark.slow),
        pytest.param("samples", "float32", 1e-5, marks=pytest.mark.study),
    ],
)
def test_numbers_do_not_depend_on_batch_or_devices(brief, dtype, tolerance, engine):
    """Trials on sums: ``trials/test_sums_engine.py``."""
    options = {"dtype": dtype, "engine": engine}
    _, reference = estimates(brief, 6, **options)
    _, other = estimates(brief, 6, devices=jax.devices()[:2], batch=2, **options)  # the last batch is filled up
    assert np.isfinite(other).all()
    assert np.abs(other - reference).max() <= tolerance * brief.inertia.max()


@pytest.mark.study
def test_float32_draws_agree_with_float64_in_distribution(brief):
    """Briefly below, without float64; and in ``sources/test_sources.py``."""
    trials = 300
    one, two = (errors(brief, trials, engine="samples", dtype=d) for d in ("float64", "float32"))
    np.testing.assert_allclose(one.std(0), two.std(0), rtol=5 / np.sqrt(trials), atol=1e-9)


def test_draws_are_bit_identical_in_any_batch(brief):
    source, key = brief.sources[0], jax.random.key(7)
    draw = lambda index, block: draw_block(source, key, index, block, jnp.dtype("float32"))  # noqa: E731
    one = jax.jit(draw)(jnp.asarray(5), jnp.asarray(3))
    many = jax.jit(jax.vmap(draw, in_axes=(0, None)))(jnp.arange(8), jnp.asarray(3))
    mapped = jax.lax.map(lambda i: draw(i, jnp.asarray(3)), jnp.arange(8))
    assert (one == many[5]).all()
    assert (one == mapped[5]).all()
    assert not (one == many[4]).any()


def test_no_two_draws_are_alike(brief):
    """Seed, source, trial and block each make other numbers; so do an experiment's bias and its samples."""
    one, other = brief.sources[0], brief.sources[2]
    dtype = jnp.dtype(float)
    draws = [
        draw_block(source, jax.random.key(seed), trial, block, dtype) / source.sigma[:, None]
        for seed, source, trial, block in [
            (0, one, 0, 0),
            (1, one, 0, 0),
            (0, other, 0, 0),
            (0, one, 1, 0),
            (0, one, 0, 1),
        ]
    ]
    for k, first in enumerate(draws):
        for second in draws[k + 1 :]:
            correlation = np.corrcoef(np.ravel(first), np.ravel(second))[0, 1]
            assert abs(correlation) < 5 / np.sqrt(12_000)  # ten pairs: 6e-6 false alarms
    np.testing.assert_allclose(np.std(draws), 1, atol=5 / np.sqrt(2 * 60_000))


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["sums", "samples"])
def test_an_added_source_changes_no_draw(brief, engine):
    many, both = estimates(brief, 3, engine=engine)
    few, fewer = estimates(only(brief, "M_bias", "omega_precision"), 3, engine=engine)
    for name in ("source:M_bias", "source:omega_precision"):
        one = both[:, :, [c.name for c in many.cases].index(name)]
        two = fewer[:, :, [c.name for c in few.cases].index(name)]
        np.testing.assert_allclose(one, two, atol=1e-14)


def test_a_new_number_does_not_compile_again(brief):
    estimates(brief, 2)
    before = trial_loop._sharded._cache_size()
    louder = dataclasses.replace(
        brief, sources=tuple(eqx.tree_at(lambda s: s.sigma, s, 2.5 * s.sigma) for s in brief.sources), mass=12.0
    )
    estimates(louder, 2)
    assert trial_loop._sharded._cache_size() == before


# --- results ---


def test_statistics_of_known_errors(generator):
    errors = generator.normal(loc=0.5, scale=2.0, size=(200_000, 6))
    found = Statistics.of(errors)
    np.testing.assert_allclose(found.mean_error, 0.5, atol=5 * 2 / np.sqrt(200_000))
    np.testing.assert_allclose(found.three_sigma, 6, rtol=0.01)
    np.testing.assert_allclose(found.mean_error_standard_error, 2 / np.sqrt(200_000), rtol=0.01)
    np.testing.assert_allclose(found.three_sigma_standard_error, 6 / np.sqrt(2 * 200_000), rtol=0.03)


def test_the_standard_error_of_three_sigma_holds_for_other_distributions(generator):
    """Of 400 repeats of uniform errors, the scatter of 3σ is the stated one (a normal law would say 1.58 times more)."""
    repeats = [Statistics.of(generator.uniform(-1, 1, size=(500, 6))) for _ in range(400)]
    scatter = np.std([r.three_sigma for r in repeats])
    np.testing.assert_allclose(scatter, np.mean([r.three_sigma_standard_error for r in repeats]), rtol=0.1)


def test_without_float64_it_warns_and_still_answers(brief):
    few, options = only(brief, "M_bias"), {"trials": 20, "trajectories": "T1"}
    options["estimators"] = ["smoothed"]
    with jax.enable_x64(False):
        with pytest.warns(PrecisionWarning, match="JAX's float64 is off"):
            result = montecarlo(few, **options)
        asked = montecarlo(few, plan=SamplingPlan(dtype="float32"), **options)
    assert "computed in float32" in result.findings()[0]
    assert asked.warnings == ()
    reference = montecarlo(few, **options)
    assert asked["T1", "smoothed"].failed == 0
    assert np.abs(asked["T1", "smoothed"].total.mean_error).max() < 0.05
    ratio = asked["T1", "smoothed"].total.three_sigma / reference["T1", "smoothed"].total.three_sigma
    assert (np.abs(np.log(ratio)) < np.log(2)).all()  # 20 trials each: standard error 0.23 of the logarithm


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [*(pytest.param(s, marks=pytest.mark.study) for s in (2.5, 3.0)), 3.0025])
def test_any_number_of_samples(brief, seconds):
    """Fewer than a block, one block, one sample more; on two devices, an odd number of trials. A run is identified as its
    trial was."""
    spec = brief.trajectories["T1"]
    old = spec.trajectory
    fewer = dataclasses.replace(old, duration=np.array(seconds), ramp=np.array(0.15 * seconds))
    few = only(brief, "M_precision", "omega_precision", "r_cg")
    experiment = dataclasses.replace(
        few, trajectories={"T": dataclasses.replace(spec, duration=seconds, trajectory=fewer)}
    )
    options = {"name": "T", "estimators": ("central",), "devices": jax.devices(), "engine": "samples"}
    first, again = (errors(experiment, 3, **options) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    run, r_cg = simulate(experiment, "T", trial=1).run, brief.r_cg_from_q + drawn_constants(experiment, 1)["r_cg"]
    found = identify(run, r_cg=np.asarray(r_cg), estimator=experiment.estimator("central"), offsets="none")
    np.testing.assert_allclose(plain(found) - brief.inertia, first[1, 0, 0], atol=1e-12)


def test_a_colon_in_a_name_is_part_of_the_name(brief):
    source = only(brief, "M_bias").sources[0]
    named = dataclasses.replace(brief, sources=(dataclasses.replace(source, name="a:b", group="c:d"),))
    breakdown = montecarlo(named, trials=2, trajectories=["T1"], estimators=["central"])["T1", "central"]
    assert (list(breakdown.groups), list(breakdown.sources)) == (["total", "c:d"], ["a:b"])


def test_failed_trials_are_counted_and_left_out():
    errors = np.ones((5, 6))
    errors[2] = np.nan
    assert Statistics.of(errors).mean_error.tolist() == [1] * 6
    assert Statistics.of(errors[2:3]).to_dict()["mean_error"]["I11"] is None


def test_a_motion_about_one_axis_fails_every_trial_and_says_so(brief):
    class OneAxis(type(brief.trajectories["T3"].trajectory)):
        def omega(self, t):
            return super().omega(t) * jnp.array([1.0, 0.0, 0.0])

    spec = brief.trajectories["T3"]
    old = spec.trajectory
    turning = OneAxis(
        angular_velocity=old.angular_velocity,
        angular_acceleration=old.angular_acceleration,
        duration=old.duration,
        ramp=old.ramp,
    )
    blind = dataclasses.replace(
        only(brief, "M_precision"), trajectories={"one": dataclasses.replace(spec, trajectory=turning)}
    )
    result = montecarlo(blind, trials=3, estimators=["central"])
    assert result["one", "central"].failed == 3
    assert "one, central: 3 of 3 trials failed" in repr(result)
    assert result.to_dict()["trajectories"]["one"]["central"]["groups"]["total"]["three_sigma"]["I22"] is None


def test_the_result_is_the_contract(brief):
    result = montecarlo(brief, trials=TRIALS, trajectories=["T2"])
    content = result.to_dict()
    assert (content["trials"], content["seed"], content["unit"]) == (TRIALS, 0, "g*m^2")
    block = content["trajectories"]["T2"]["smoothed"]
    assert set(block["groups"]) == {"total", "load_cell", "cg", "imu"}
    assert set(block["sources"]) == {s.name for s in brief.sources}
    for part in ("mean_error", "mean_error_standard_error", "three_sigma", "three_sigma_standard_error"):
        assert set(block["groups"]["total"][part]) == {"I11", "I12", "I13", "I22", "I23", "I33"}
    total = result["T2", "smoothed"].total
    assert block["groups"]["total"]["three_sigma"]["I33"] == GRAM_METRE * total.three_sigma[5]
    assert content["provenance"]["trials"] == TRIALS
    assert content["provenance"]["engine"] == "sums"
    assert "T2" in repr(result)
    assert "<table>" in result._repr_html_()
    table = share_table(result)
    assert table.head == ["3σ alone, % of total", "T2, central", "T2, smoothed"]
    shares = [float(row[2] or 0) for row in table.rows]
    assert [row[0] for row in table.rows[:1]] == ["group load cell"]
    assert shares[:3] == sorted(shares[:3], reverse=True)
    assert shares[3:] == sorted(shares[3:], reverse=True)
    assert max(map(len, repr(table).splitlines())) < 60


@pytest.mark.parametrize("trials", [0, -3])
def test_no_trials_are_refused(brief, trials):
    with pytest.raises(ExperimentError, match=f"{trials} trials: ask for one or more"):
        montecarlo(brief, trials=trials)

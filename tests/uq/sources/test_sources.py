"""Error sources: off gives nothing, alone gives what plain NumPy says, sums and samples agree."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from tests.helpers.source_lab import BY_SAMPLES, IN_FLOAT32, experiment, least_squares, simulated, source
from tests.helpers.source_lab import one_trial as plain_trial
from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo
from uq.monte_carlo.campaign.simulation import simulate
from uq.monte_carlo.campaign.trial_setup import prepare_engine, setting_of
from uq.monte_carlo.trials import trial_loop
from uq.monte_carlo.trials.samples_engine import prepare_samples, smooth_signals
from uq.sources.constant_errors import errors_of, errors_of_cases
from uq.sources.draws import draw_constants

THREE = {
    "N": ["1 N", "-2 N", "3 N"], "N*m": ["0.1 N*m", "-0.2 N*m", "0.3 N*m"], "rad/s": ["1 mrad/s", "-2 mrad/s", "3 mrad/s"],
    "%": ["1 %", "-2 %", "0.5 %"], "rad": ["10 mrad", "-20 mrad", "30 mrad"], "m": ["1 mm", "-2 mm", "3 mm"],
    "N/s": ["1 N/s", "-2 N/s", "3 N/s"], "N*m/s": ["0.1 N*m/s", "-0.2 N*m/s", "0.3 N*m/s"],
    "rad/s/s": ["1 mrad/s/s", "-2 mrad/s/s", "3 mrad/s/s"],
}  # fmt: skip
ONE = np.array([1.0, -2.0, 3.0])
RELATIVE = np.array([0.01, -0.02, 0.005])
ZERO = np.zeros(3)
MATRIX = 0.01 * np.sin(np.arange(36.0)).reshape(6, 6)
AIR = {"centre_from_cg": ["10 mm", "-20 mm", "30 mm"]}
CENTRE = np.array([0.01, -0.02, 0.03])


def cross_talk_strings(matrix):
    units = [["%" if (i < 3) == (j < 3) else "N/(N*m)" if i < 3 else "N*m/N" for j in range(6)] for i in range(6)]
    return [
        [f"{float(matrix[i, j]) * (100 if units[i][j] == '%' else 1)!r} {units[i][j]}" for j in range(6)]
        for i in range(6)
    ]


# (target, kind, mean in the file, further keys, what plain NumPy is told)
CONSTANTS = [
    ("F", "bias", THREE["N"], {}, {"cell_offset": np.r_[ONE, ZERO]}),
    ("M", "bias", THREE["N*m"], {}, {"cell_offset": np.r_[ZERO, 0.1 * ONE]}),
    ("omega", "bias", THREE["rad/s"], {}, {"gyro_offset": 1e-3 * ONE}),
    ("F", "drift", THREE["N/s"], {}, {"cell_slope": np.r_[ONE, ZERO]}),
    ("M", "drift", THREE["N*m/s"], {}, {"cell_slope": np.r_[ZERO, 0.1 * ONE]}),
    ("omega", "drift", THREE["rad/s/s"], {}, {"gyro_slope": 1e-3 * ONE}),
    ("F", "scale", THREE["%"], {}, {"cell_scale": np.r_[RELATIVE, ZERO]}),
    ("M", "scale", THREE["%"], {}, {"cell_scale": np.r_[ZERO, RELATIVE]}),
    ("omega", "scale", THREE["%"], {}, {"gyro_scale": RELATIVE}),
    ("wrench", "cross_talk", cross_talk_strings(MATRIX), {}, {"cross_talk": MATRIX}),
    ("wrench", "misalignment", THREE["rad"], {}, {"cell_turn": 0.01 * ONE}),
    ("omega", "misalignment", THREE["rad"], {}, {"gyro_turn": 0.01 * ONE}),
    ("omega", "delay", "3 ms", {}, {"delay": 3e-3}),
    ("omega", "delay", "-3 ms", {}, {"delay": -3e-3}),
    ("gravity", "bias", "0.05 m/s^2", {}, {"gravity": 0.05}),
    ("r_cg_from_omb", "bias", THREE["m"], {}, {"cg": 1e-3 * ONE}),
    ("tilt", "bias", THREE["rad"], {}, {"tilt": 0.01 * ONE}),
    ("displaced_air", "bias", "30 g", AIR, {"displaced": (0.03, CENTRE)}),
    ("entrained_air", "bias", "50 g", AIR | {"radii_of_gyration": ["0.15 m", "0.04 m", "0.2 m"]},
     {"entrained": (0.05, CENTRE, np.array([0.15, 0.04, 0.2]))}),
]  # fmt: skip


def zeros_like(figures):
    if isinstance(figures, list):
        return [zeros_like(item) for item in figures]
    return "0 " + figures.partition(" ")[2]


def known(target, kind, mean, keys, *, name="s"):
    """A source whose draw is its mean."""
    return source(name, target, kind, mean=mean, sigma=zeros_like(mean), **keys)


one_trial = eqx.filter_jit(plain_trial)  # one for all tests: engines that differ in numbers only compile once


def engine_of(e, name="sums", **options):
    return prepare_engine(e, e.trajectories["T"], e.estimators, engine=name, **options)[0]


def estimates(e, engine=None, key=0, index=0):
    """One trial's estimates by case, (estimators, 6)."""
    engine = engine or engine_of(e)
    inertia = one_trial(engine, jax.random.key(key), jnp.asarray(index))
    return dict(zip([case.name for case in engine.cases], np.asarray(inertia).swapaxes(0, 1), strict=True))


@eqx.filter_jit
def records(engine):
    """The noiseless record of every case, on the leading axis."""
    draws = draw_constants(engine.sources, engine.mixing, jax.random.key(0), 0, jnp.dtype(float))
    return jax.lax.map(
        lambda errors: smooth_signals(engine, errors),
        errors_of_cases(engine.sources, draws, [case.sources for case in engine.cases]),
    )


# --- alone, against plain NumPy; off ---


@pytest.fixture(scope="module")
def every():
    """Every constant source, each with a known draw."""
    return experiment(*(known(*case[:4], name=f"s{k}") for k, case in enumerate(CONSTANTS)))


@pytest.fixture(scope="module")
def silent():
    """The same sources, off."""
    off = [(target, kind, zeros_like(mean), keys) for target, kind, mean, keys, _ in CONSTANTS]
    return experiment(*(known(*case, name=f"s{k}") for k, case in enumerate(off)))


@pytest.fixture(scope="module")
def truth():
    """The estimates without errors."""
    return estimates(experiment())["total"]


@pytest.fixture(scope="module")
def recorded(every):
    """What the sensors read without noise, (n, 6) and (n, 3), by case; nothing is compiled for one case more."""
    engine = engine_of(every, "samples")
    forces, moments, omegas = (np.asarray(signal).swapaxes(1, 2) for signal in records(engine))
    names = [case.name for case in engine.cases]
    return dict(zip(names, zip(np.concatenate([forces, moments], axis=2), omegas, strict=True), strict=True))


@pytest.fixture(scope="module")
def of_sums(every):
    return estimates(every)


def test_each_source_alone_does_what_plain_numpy_says(every, recorded, of_sums):
    """To the sensors; and to the estimates from sums. Those from the sensors' samples: ``test_reference_trial.py``."""
    for k, (target, kind, *_, told) in enumerate(CONSTANTS):
        name = f"source:s{k}"
        wrench, omega = simulated(every, **told)
        np.testing.assert_allclose(recorded[name][0], wrench, atol=2e-11, err_msg=f"{target} {kind}")
        np.testing.assert_allclose(recorded[name][1], omega, atol=1e-14, err_msg=f"{target} {kind}")
        for j, estimator in enumerate(("central", "smoothed")):
            expected = least_squares(every, wrench, omega, every.r_cg_from_q, estimator)
            np.testing.assert_allclose(of_sums[name][j], expected, atol=1e-12, err_msg=f"{target} {kind}")


@pytest.mark.slow
def test_a_source_that_is_off_gives_nothing(silent, truth):
    engine = engine_of(silent, "samples")
    forces, moments, omegas = records(engine)
    wrench, omega = simulated(experiment())
    for force, moment, rate in zip(forces, moments, omegas, strict=True):
        np.testing.assert_allclose(np.hstack([force.T, moment.T]), wrench, atol=2e-11)
        np.testing.assert_allclose(rate.T, omega, atol=1e-14)
    for tensors in (estimates(silent, engine), estimates(silent)):
        np.testing.assert_allclose(list(tensors.values()), np.broadcast_to(truth, (len(tensors), 2, 6)), atol=1e-12)


def test_all_together_in_sums_in_samples_and_in_numpy(every, recorded, of_sums):
    """The two delays cancel."""
    told = {}
    for case in CONSTANTS:
        for key, value in case[4].items():
            told[key] = value if key not in told else told[key] + value
    wrench, omega = simulated(every, **told)
    np.testing.assert_allclose(recorded["total"][0], wrench, atol=1e-10)
    np.testing.assert_allclose(recorded["total"][1], omega, atol=1e-13)
    for k, estimator in enumerate(("central", "smoothed")):
        expected = least_squares(every, wrench, omega, every.r_cg_from_q, estimator)
        np.testing.assert_allclose(of_sums["total"][k], expected, atol=1e-11)


@pytest.mark.slow  # with the other sources: test_campaign.py, by its variance
def test_r_cg_errs_in_the_estimate_and_in_no_sensor(truth):
    e = experiment(known("r_cg", "bias", THREE["m"], {}))
    wrench, omega = simulated(e)
    np.testing.assert_allclose(simulate(e).run.force, wrench[:, :3], atol=2e-11)
    expected = least_squares(e, wrench, omega, e.r_cg_from_q + 1e-3 * ONE, "central")
    np.testing.assert_allclose(estimates(e)["total"][0], expected, atol=1e-12)


def test_what_changes_the_force_alone_does_nothing_to_the_tensor(every, of_sums):
    """Gravity, CG height and tilt."""
    truth = [least_squares(every, *simulated(every), every.r_cg_from_q, name) for name in ("central", "smoothed")]
    for k, (target, *_) in enumerate(CONSTANTS):
        if target in ("gravity", "r_cg_from_omb", "tilt"):
            np.testing.assert_allclose(of_sums[f"source:s{k}"], truth, atol=1e-12)


@pytest.mark.slow  # gains and air among all sources, against plain NumPy: above
def test_closed_forms(truth):
    """A common scale factor scales the tensor; air that moves along adds its own."""
    percent = ["1 %"] * 3
    scaled = experiment(known("F", "scale", percent, {}, name="a"), known("M", "scale", percent, {}, name="b"))
    np.testing.assert_allclose(estimates(scaled)["total"], 1.01 * truth, atol=1e-13)
    radii = {"radii_of_gyration": ["0.1 m", "0.2 m", "0.3 m"]}
    air, nothing = (
        estimates(experiment(known("entrained_air", "bias", mass, radii), rate="1000 Hz"))["total"][0]
        for mass in ("50 g", "0 g")
    )
    # the central difference's gain at 1.5 Hz is within (2π 1.5/1000)²/6 = 1.5e-5
    np.testing.assert_allclose(air - nothing, 0.05 * np.array([0.01, 0, 0, 0.04, 0, 0.09]), atol=2e-5 * 0.0045)


# --- sums and samples ---

NOISY = [
    source("F_noise", "F", "precision", sigma=["5 N", "5 N", "10 N"]),
    source("M_noise", "M", "precision", distribution="rectangular", half_width=["0.5 N*m"] * 3),
    source("w_noise", "omega", "precision", sigma=["1 mrad/s", "2 mrad/s", "3 mrad/s"]),
    source("w_more", "omega", "precision", distribution="u_shaped", half_width=["1 mrad/s"] * 3),
    source("r_cg", "r_cg", "bias", sigma=["1 mm"] * 3),
]
DRAWN = [
    source(f"s{k}", target, kind, sigma=[[x.replace("-", "") for x in row] for row in mean] if kind == "cross_talk"
           else [x.replace("-", "") for x in mean] if isinstance(mean, list) else mean, **keys)
    for k, (target, kind, mean, keys, _) in enumerate(CONSTANTS) if kind != "delay"
]  # fmt: skip


@pytest.mark.slow  # briefly: trials/test_sums_engine.py
def test_drawn_correlated_noise_has_the_distribution_of_its_samples():
    noise = [
        NOISY[0],
        source("M_normal", "M", "precision", sigma=["0.4 N*m"] * 3, correlation=[[1, 0.9, 0], [0.9, 1, 0], [0, 0, 1]]),
    ]
    link = {"sources": ["F_noise", "M_normal"], "coefficient": [[0, 0.3, 0], [0.3, 0, 0], [0, 0, 0.8]]}
    e = experiment(*noise, correlations=[link])
    runs = [
        montecarlo(e, trials=1500, plan=plan, estimators="smoothed").errors["T"][:, 0, 0]
        for plan in (SamplingPlan(), BY_SAMPLES)
    ]
    one, two = (np.cov(run.T) for run in runs)
    # a covariance's standard error is √((cᵢᵢcⱼⱼ + cᵢⱼ²)/N): 21 comparisons at 5 of them: 1e-5 false alarms
    error = np.sqrt((np.outer(np.diag(one), np.diag(one)) + one**2) * 2 / 1500)
    assert (np.abs(one - two) < 5 * error).all()


@pytest.mark.slow
def test_constant_errors_beside_noise_are_the_same_by_samples_and_on_sums():
    """Correlated constants of every kind, and a delay, over the seam of two blocks: the cases without noise agree."""
    link = [{"sources": ["s0", "s6"], "coefficient": 0.5}]
    late = source("late", "omega", "delay", mean="2 ms", sigma="3 ms")
    e = experiment(*NOISY[:3], *DRAWN, late, correlations=link, duration="16 s")
    by_samples, on_sums = (estimates(e, engine_of(e, name), key=3, index=2) for name in ("samples", "sums"))
    noisy = {"total", *(f"{kind}{s['name']}" for s in NOISY[:3] for kind in ("source:", "group:group of "))}
    names = [name for name in by_samples if name not in noisy]
    assert len(names) > 2 * len(DRAWN)
    scatter = np.ptp([by_samples[name] for name in names], axis=0)
    assert scatter.min() > 1e-4  # the cases differ
    for name in names:
        np.testing.assert_allclose(on_sums[name], by_samples[name], atol=2e-9, err_msg=name)


@pytest.mark.slow
def test_samples_in_float32_agree_and_numbers_do_not_compile_again():
    some, run = (NOISY[0], NOISY[2]), partial(montecarlo, trials=40, estimators="smoothed")
    e = experiment(*some, known("omega", "delay", "3 ms", {}), source("q", "F", "quantisation", step=["1 N"] * 3))
    double, single = (run(e, plan=plan)["T", "smoothed"].total for plan in (BY_SAMPLES, IN_FLOAT32))
    np.testing.assert_allclose(double.three_sigma, single.three_sigma, rtol=5 / np.sqrt(40))
    before = trial_loop._sharded._cache_size()
    other = experiment(*some, known("omega", "delay", "4 ms", {}), source("q", "F", "quantisation", step=["2 N"] * 3))
    run(other, plan=BY_SAMPLES)
    assert trial_loop._sharded._cache_size() == before


# --- what is not linear ---


def test_saturation_ends_the_range_and_quantisation_rounds():
    e = experiment(
        source("limit", "M", "saturation", limit=["0.5 N*m", "5 N*m", "0.5 N*m"]),
        source("step", "M", "quantisation", step=["0.3 N*m", "0.2 N*m", "0.1 N*m"]),
        source("gyro limit", "omega", "saturation", limit=["0.2 rad/s"] * 3),
    )
    wrench, omega = simulated(e)
    limit, step = np.array([0.5, 5, 0.5]), np.array([0.3, 0.2, 0.1])
    moment = step * np.round(np.clip(wrench[:, 3:], -limit, limit) / step)
    run = simulate(e).run
    np.testing.assert_allclose(run.moment, moment, atol=1e-12)
    np.testing.assert_allclose(run.omega, np.clip(omega, -0.2, 0.2), atol=1e-14)
    assert (np.abs(run.moment) < np.abs(wrench[:, 3:]) - 0.1).any()
    expected = least_squares(e, np.hstack([run.force, run.moment]), run.omega, e.r_cg_from_q, "central")
    np.testing.assert_allclose(estimates(e)["total"][0], expected, atol=1e-12)
    of_step = least_squares(
        e, np.hstack([wrench[:, :3], step * np.round(wrench[:, 3:] / step)]), omega, e.r_cg_from_q, "central"
    )
    np.testing.assert_allclose(estimates(e)["source:step"][0], of_step, atol=1e-12)
    assert not any(s.drawn for s in e.sources)


def test_quantisation_of_a_moving_signal_is_rectangular_noise():
    """The error of rounding to a step q, over many steps, has variance q²/12 (GUM F.2.2.1)."""
    e = experiment(source("q", "F", "quantisation", step=["0.01 N"] * 3), duration="40 s", ramp="4 s")
    error = simulate(e).run.force - simulated(e)[0][:, :3]
    assert np.abs(error).max() < 0.005 * (1 + 1e-9)
    assert stats.kstest(error[:, 0] / 0.01 + 0.5, "uniform").pvalue > 1e-3


def test_noise_comes_before_the_end_of_the_range():
    e = experiment(NOISY[0], source("limit", "F", "saturation", limit=["4 N", "4 N", "190 N"]))
    force = simulate(e).run.force
    assert np.mean(np.abs(force[:, 0]) == 4) > 0.1
    assert np.abs(force[:, 2]).max() == 190


# --- derivatives ---


@pytest.mark.slow  # no part of the program differentiates them: the law does sums, analysis/propagation/test_experiment_law.py
def test_signals_are_smooth_in_the_draws():
    """The derivative of the record by every draw at once, against central differences."""
    e = experiment(*DRAWN, source("delay", "omega", "delay", sigma="1 ms"))
    setup = prepare_samples(setting_of(e, e.trajectories["T"], ()))
    draws = jax.jit(lambda key: draw_constants(e.sources, (), key, 0, jnp.dtype(float)))(jax.random.key(0))
    record = lambda draws: smooth_signals(setup, errors_of(setup.sources, draws))  # noqa: E731
    both = jax.jit(lambda point, direction: jax.jvp(record, (point,), (direction,)))
    direction = jax.tree.map(
        lambda x: 0.3 * jnp.cos(jnp.arange(float(x.size))).reshape(x.shape) * jnp.abs(x).max(), draws
    )
    for point in (draws, jax.tree.map(jnp.zeros_like, draws)):  # also where nothing errs
        step = 1e-4
        ahead, at, behind = (
            both(jax.tree.map(lambda x, d, s=s: x + s * d, point, direction), direction) for s in (step, 0.0, -step)
        )
        for one, two, by in zip(ahead[0], behind[0], at[1], strict=True):
            np.testing.assert_allclose(by, (one - two) / (2 * step), atol=1e-6 * float(jnp.abs(by).max()))
    assert all(s.drawn for s in e.sources)

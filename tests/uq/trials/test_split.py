"""Cases by sums, by samples or once: which gets what, and the same distribution whichever way."""

import dataclasses
import tomllib
from itertools import product
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.source_lab import experiment, source
from uq.campaign.campaign import montecarlo
from uq.campaign.trial_setup import prepare_setup, true_motion
from uq.experiment.experiment import Experiment
from uq.gram_sums.delayed_omega import delayed_omega, displacement
from uq.sources.kinds.delay import LARGEST_REMAINDER
from uq.trials.engines import how_computed
from uq.trials.samplewise import SampledSetup
from uq.trials.split import SplitSetup

NOISE = [
    source("F_noise", "F", "precision", sigma=["5 N", "5 N", "10 N"]),
    source("M_noise", "M", "precision", sigma=["0.4 N*m"] * 3),
    source("w_noise", "omega", "precision", sigma=["2 mrad/s"] * 3),
]
STEPS = [
    source("F_step", "F", "quantisation", step=["10 N", "10 N", "20 N"]),
    source("M_step", "M", "quantisation", step=["0.8 N*m"] * 3),
    source("w_step", "omega", "quantisation", step=["4 mrad/s"] * 3),
]
"""As coarse as the noise allows."""


def how(e, **options):
    """What a result says of how it was computed, for whichever estimator."""
    return how_computed(prepare_setup(e, e.trajectories["T"], e.estimators[:1], **options), e.sources)


def figures(e, **options):
    """3σ and mean error of all sources together, then their standard errors."""
    total = montecarlo(e, estimators="smoothed", **options)["T", "smoothed"].total
    return [
        np.concatenate([getattr(total, f"{figure}{of}") for figure in ("mean_error", "three_sigma")])
        for of in ("", "_standard_error")
    ]


ROUNDED = [*NOISE[1:], *STEPS[1:]]
FINE = [*NOISE[1:], *(step | {"step": ["1e-6 " + step["step"][0].split()[1]] * 3} for step in STEPS[1:])]
"""The same with steps that nobody sees: the same shapes, compiled once."""


@pytest.fixture(scope="module")
def of_samples():
    return figures(experiment(*ROUNDED), trials=1000, sampling="samples")


@pytest.fixture(scope="module")
def without():
    return figures(experiment(*FINE), trials=3000)


@pytest.mark.parametrize("sampling", ["conditioned", pytest.param("collapsed", marks=pytest.mark.study)])
def test_quantisation_in_sums_is_quantisation_of_samples(sampling, of_samples, without):
    """At the coarsest step that counts as noise, which widens 3σ by a sixth; 12 figures at 4.5: 1e-4 false alarms."""
    sums, error = figures(experiment(*ROUNDED), trials=3000, sampling=sampling)
    samples, error_of_samples = of_samples
    assert (np.abs(sums - samples) < 4.5 * np.hypot(error, error_of_samples)).all()
    assert np.max(np.abs(without[0] - samples) / np.hypot(error, error_of_samples)) > 4.5  # it would be seen


MORE = {
    "delay": [source("late", "omega", "delay", sigma="1 ms")],
    "flicker": [
        source("F_flicker", "F", "coloured", flicker=["2 N"] * 3),
        source("w_flicker", "omega", "coloured", flicker=["1 mrad/s"] * 3),
    ],
    "quantisation": [
        source("F_step", "F", "quantisation", step=["10 N", "10 N", "20 N"]),
        source("M_step", "M", "quantisation", step=["0.7 N*m"] * 3),
        source("w_step", "omega", "quantisation", step=["0.7 mrad/s"] * 3),
    ],
}


@pytest.mark.study
@pytest.mark.parametrize("more", MORE)
def test_ten_thousand_trials_either_way(more):
    """T1 in ten seconds, 4,000 samples, the preset's noise: within 1 % or four standard errors of the difference."""
    document = tomllib.loads(Path("docs/experiments/t1-10s.toml").read_text("utf-8"))
    e = Experiment.from_dict(document | {"source": [*document["source"], *MORE[more]]})
    reference = montecarlo(e, trials=10_000, sampling="samples")
    ways = {"conditioned": 10_000} | ({"collapsed": 100_000} if more == "quantisation" else {})
    for sampling, trials in ways.items():
        result = montecarlo(e, trials=trials, sampling=sampling)
        worst, largest = 0.0, 0.0
        for estimator, figure in product(("central", "smoothed"), ("three_sigma", "mean_error")):
            totals = [each["T1", estimator].total for each in (result, reference)]
            value, expected = (getattr(total, figure) for total in totals)
            error = np.hypot(*(getattr(total, f"{figure}_standard_error") for total in totals))
            excess = np.abs(value - expected)
            assert (excess <= np.maximum(0.01 * np.abs(expected), 4 * error)).all(), (sampling, estimator, figure)
            worst = max(worst, np.max(excess / error))
            largest = max(largest, np.max(excess / expected) if figure == "three_sigma" else 0)
        print(f"{more}, {sampling}: {worst:.1f} standard errors at most, 3σ within {largest:.2%}")


def test_a_coarse_step_gets_samples_and_a_step_alone_is_computed_once():
    fine, coarse = (source("step", "F", "quantisation", step=[s] * 3) for s in ("10 N", "10.1 N"))
    words = {"in_sums": {"step": "white noise of variance step²/12"}, "once": ["group:group of step", "source:step"]}
    assert how(experiment(NOISE[0], fine)) == words
    assert how(experiment(NOISE[0], coarse)) == {"by_samples": ["total"], "once": words["once"]}
    assert how(experiment(NOISE[0], fine), sampling="collapsed") == words
    assert how(experiment(NOISE[0], coarse), sampling="collapsed") == how(experiment(NOISE[0], coarse))
    result = montecarlo(experiment(NOISE[0], fine), trials=2, estimators="smoothed")
    assert result.provenance["computed"] == {"T": words}
    samples = how(experiment(NOISE[0], fine), sampling="samples")
    assert list(samples) == ["by_samples"]
    assert len(samples["by_samples"]) == 5


def test_noise_that_does_not_round_independently_gets_samples():
    """Correlated noise, noise of another distribution, two steps on one signal, and the end of the range."""
    step, one = source("step", "F", "quantisation", step=["1 N"] * 3), [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]
    rectangular = source("F_noise", "F", "precision", distribution="rectangular", half_width=["9 N"] * 3)
    correlated = source("F_noise", "F", "precision", sigma=["5 N"] * 3, correlation=one)
    other = source("other", "F", "quantisation", step=["0.5 N"] * 3)
    limit = source("limit", "F", "saturation", limit=["100 N"] * 3)
    for sources in ([rectangular, step], [correlated, step], [NOISE[0], step, other], [NOISE[0], limit]):
        assert how(experiment(*sources))["by_samples"] == ["total"]
    white = source("F_noise", "F", "coloured", white=["1 N*s**0.5"] * 3)
    assert "by_samples" not in how(experiment(white, step))


def test_a_range_that_is_far_needs_no_samples():
    """The force goes to 195 N, and its noise to 6 × 10 N beyond."""
    near, far = (source("limit", "F", "saturation", limit=[limit] * 3) for limit in ("250 N", "256 N"))
    assert how(experiment(NOISE[0], near))["by_samples"] == ["total"]
    words = {"limit": "nothing: the signal stays within its range"}
    assert how(experiment(NOISE[0], far)) == {"in_sums": words}


@pytest.fixture(scope="module")
def three_ways():
    """Cases by sums, by samples and once; without noise of the load cell, whose sums are drawn."""
    limit = source("limit", "omega", "saturation", limit=["0.3 rad/s"] * 3)
    return experiment(NOISE[2], limit, source("bias", "F", "bias", sigma=["1 N"] * 3))


@pytest.fixture(scope="module")
def split(three_ways):
    return montecarlo(three_ways, trials=5, seed=3).errors["T"]


def test_cases_by_samples_are_those_of_the_samplewise_engine(three_ways, split):
    """A case alone and among others."""
    e = three_ways
    plain = montecarlo(e, trials=5, sampling="samples", seed=3).errors["T"]
    assert isinstance(prepare_setup(e, e.trajectories["T"], e.estimators), SplitSetup)
    assert np.abs(np.diff(plain[:, 0, :2], axis=1)).min() > 0
    np.testing.assert_allclose(split, plain, atol=1e-12)


def test_batches_and_devices_change_nothing(three_ways, split):
    other = montecarlo(three_ways, trials=5, seed=3, devices=jax.devices()[:2], batch=2).errors["T"]
    np.testing.assert_allclose(split, other, atol=1e-13)


@pytest.mark.parametrize("sigma", ["1 ms", "10 ms", "30 ms"])
def test_a_delay_is_a_polynomial_where_its_remainder_is_small(sigma):
    e = experiment(NOISE[2], source("late", "omega", "delay", sigma=sigma))
    spec = e.trajectories["T"]
    trajectory, motion, seconds = spec.trajectory, true_motion(e, spec), 1e-3 * float(sigma.split()[0])
    delayed = delayed_omega(trajectory, motion.t, 6 * seconds)
    later = np.array(jax.vmap(trajectory.omega)(motion.t - 2.3 * seconds)).T - np.array(motion.omega)
    off = np.abs(displacement(delayed.coefficients, jnp.asarray(2.3 / 6)) - later).max()
    assert off <= max(delayed.remainder * np.abs(later).max() * 6, 1e-12)
    by_samples = delayed.remainder > LARGEST_REMAINDER
    assert by_samples == (sigma == "30 ms")
    expected = {"by_samples": [c.name for c in prepare_setup(e, spec, e.estimators).cases if "late" in c.sources]}
    assert how(e) == (expected if by_samples else {"in_sums": {"late": "a polynomial in the delay"}})


def test_nothing_to_do_by_sums():
    """Every case needs samples, or none is drawn at all."""
    limit = source("limit", "F", "saturation", limit=["100 N"] * 3)
    e = experiment(limit)
    setup = prepare_setup(e, e.trajectories["T"], e.estimators)
    assert setup.parts == ()
    errors = montecarlo(e, trials=3).errors["T"]
    assert (errors == errors[0]).all()
    assert np.abs(errors).max() > 1e-3
    plain = montecarlo(e, trials=1, sampling="samples").errors["T"]
    np.testing.assert_allclose(errors[:1], plain, atol=1e-15)
    assert isinstance(prepare_setup(e, e.trajectories["T"], e.estimators, sampling="samples"), SampledSetup)
    silent = dataclasses.replace(e, sources=())
    np.testing.assert_allclose(montecarlo(silent, trials=1).errors["T"][0, 0], 0, atol=1e-2)

"""Trials on drawn sums: the same distribution as trials on samples, whatever the batch; what they cannot draw is refused."""

import dataclasses

import jax
import numpy as np
import pytest

from uq.campaign import montecarlo
from uq.distributions import StudentT
from uq.experiment import ExperimentError

TRIALS = 20_000


@pytest.fixture(scope="module")
def both(short):
    options = {"trajectories": ["T1", "T3"], "estimators": ["central", "smoothed"]}
    return montecarlo(short, trials=400, **options), montecarlo(short, trials=TRIALS, sampling="collapsed", **options)


@pytest.mark.parametrize("pair", [(t, e) for t in ("T1", "T3") for e in ("central", "smoothed")], ids="-".join)
def test_drawn_sums_give_what_samples_give(both, pair):
    """Every case and component: 264 comparisons in all at 4.5 standard errors, a false alarm in 500 seeds."""
    by_samples, collapsed = (result[pair] for result in both)
    assert collapsed.failed == 0
    for kind in ("groups", "sources"):
        for name, reference in getattr(by_samples, kind).items():
            found = getattr(collapsed, kind)[name]
            for figure in ("mean_error", "three_sigma"):
                one, two = getattr(found, figure), getattr(reference, figure)
                error = np.hypot(
                    getattr(found, f"{figure}_standard_error"), getattr(reference, f"{figure}_standard_error")
                )
                assert (np.abs(one - two) <= 4.5 * error + 1e-15).all(), (name, figure, (one - two) / error)


def test_numbers_do_not_depend_on_batch_or_devices(short):
    def errors(devices, batch):
        options = {"trajectories": "T1", "estimators": "central", "sampling": "collapsed"}
        return montecarlo(short, trials=7, devices=jax.devices()[:devices], batch=batch, **options).errors["T1"]

    reference = errors(1, 1)
    for devices, batch in ((1, 3), (2, 2)):
        np.testing.assert_allclose(errors(devices, batch), reference, atol=1e-12 * short.inertia.max())


def test_without_errors_the_truth_comes_out(short):
    silent = dataclasses.replace(short, sources=())
    result = montecarlo(silent, trials=2, trajectories="T1", estimators="smoothed", sampling="collapsed")
    reference = montecarlo(silent, trials=2, trajectories="T1", estimators="smoothed")
    np.testing.assert_allclose(result.errors["T1"], reference.errors["T1"], atol=1e-12 * short.inertia.max())


def test_what_cannot_be_drawn_is_refused(short):
    noise = short.sources[[s.name for s in short.sources].index("omega_precision")]
    heavy = dataclasses.replace(noise, shape=StudentT(0.0, 1.0, 5.0))
    other = dataclasses.replace(short, sources=(heavy,))
    with pytest.raises(ExperimentError, match="the noise of omega_precision is not normal: draw samples"):
        montecarlo(other, trials=2, trajectories="T1", sampling="collapsed")
    with pytest.raises(ExperimentError, match="float64 only"):
        montecarlo(short, trials=2, trajectories="T1", sampling="collapsed", dtype="float32")

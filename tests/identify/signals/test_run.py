"""Runs: what is accepted, what is refused and in which words, resampling."""

import numpy as np
import pytest

from identify.signals.run import Run, RunError


def arrays(n=100, rate=100.0, start=0.0):
    t = start + np.arange(n) / rate
    return t, np.ones((n, 3)), np.ones((n, 3)), np.ones((n, 3))


def test_uniform_samples_are_kept_as_they_are():
    t, force, moment, omega = arrays()
    run = Run.from_arrays(t, force, moment, omega)
    np.testing.assert_array_equal(run.omega, omega)
    assert run.rate == pytest.approx(100)


def test_unequal_clocks_meet_on_the_slower_ones_grid():
    fine, coarse = np.arange(0, 10, 1e-3), np.arange(0.5, 9, 1e-2) + 0.0003
    signal = lambda t: np.stack([np.sin(t), np.cos(2 * t), t**2], axis=1)  # noqa: E731
    run = Run.from_channels(fine, signal(fine), signal(fine), coarse, signal(coarse))
    assert run.rate == pytest.approx(100)
    np.testing.assert_allclose(run.force, signal(run.t), atol=3e-5)  # the low-pass is flat within 1e-5
    np.testing.assert_allclose(run.omega, signal(run.t), atol=3e-5)
    assert run.t[0] >= 0.5003
    assert run.t[-1] <= 9


def test_a_gap_is_named():
    t, force, moment, omega = arrays(1000)
    keep = np.r_[0:400, 460:1000]
    run = Run.from_channels(t, force, moment, t[keep], omega[keep])
    assert "1 gap in the angular velocity, the longest 0.61 s" in run.warnings[0]
    inside = (run.t > t[399] + 1e-9) & (run.t < t[460] - 1e-9)
    assert run.missing[inside].all()
    assert not run.missing[~inside][run.t[~inside] != t[399]].any()


def test_jitter_is_named(generator):
    t, force, moment, omega = arrays(1000)
    run = Run.from_arrays(t + generator.uniform(-2e-3, 2e-3, 1000), force, moment, omega)
    assert "the stamps of the wrench jitter by 1." in run.warnings[0]
    assert run.rate == pytest.approx(100, rel=1e-3)
    assert Run.from_arrays(t, force, moment, omega).warnings == ()


@pytest.mark.parametrize(("share", "words"), [(0.05, ""), (0.2, "of the samples of the wrench are missing")])
def test_samples_that_are_lost_are_no_jitter(generator, share, words):
    t, *signals = arrays(1000)
    kept = generator.random(1000) >= share
    text = " ".join(Run.from_arrays(t[kept], *(signal[kept] for signal in signals)).warnings)
    assert words in text
    assert "jitter" not in text


def test_between_cuts_and_refuses_an_empty_part():
    run = Run.from_arrays(*arrays())
    assert len(run.between(0.2, 0.5).t) == 31
    with pytest.raises(RunError, match="fewer than two samples in run between 5 and 6 s"):
        run.between(5.0, 6.0)


def broken(what):
    t, force, moment, omega = arrays()
    if what == "nan":
        force[7, 1] = np.nan
    elif what == "huge":
        moment[9, 2] = -1e300
    elif what == "infinite time":
        t[3] = np.inf
    elif what == "backwards":
        t[50] = t[48]
    elif what == "still":
        t[50] = t[49]
    elif what == "shape":
        omega = omega[:, :2]
    elif what == "length":
        moment = moment[:-1]
    elif what == "one":
        t, force, moment, omega = (a[:1] for a in (t, force, moment, omega))
    elif what == "scalar":
        t = t[:, None]
    return t, force, moment, omega


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("nan", r"force in run is not finite at sample 7 \(1 such samples\)"),
        ("huge", r"moment in run is 1\.0e\+300 at sample 9: no sensor reads so much"),
        ("infinite time", "time in run is not finite at sample 3"),
        ("backwards", r"time of the wrench in run runs backwards at sample 50"),
        ("still", r"time of the wrench in run stands still at sample 50"),
        ("shape", r"omega in run has shape \(100, 2\): give \(100, 3\)"),
        ("length", r"moment in run has shape \(99, 3\)"),
        ("one", "fewer than two samples of the wrench in run"),
        ("scalar", r"times of the wrench in run have shape \(100, 1\)"),
    ],
)
def test_bad_input_is_refused_in_one_line(what, message):
    with pytest.raises(RunError, match=message) as caught:
        Run.from_arrays(*broken(what))
    assert "\n" not in str(caught.value)


def test_sensors_that_do_not_overlap_are_refused():
    t, force, moment, omega = arrays()
    with pytest.raises(
        RunError, match=r"no overlap in run: wrench from 0 to 0\.99 s, angular velocity from 5 to 5\.99 s"
    ):
        Run.from_channels(t, force, moment, t + 5, omega)

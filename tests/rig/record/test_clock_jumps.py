"""Device times that no clock shows, a host's clock that is set back, eight thousand samples a second."""

import collections
import itertools
import threading
import time

import numpy as np
import pytest

from rig import runs
from rig.devices.parser import Sample
from rig.record.device_clock import ClockTracker
from rig.record.reader import Event
from rig.record.recorder import Recorder
from rig.record.rig_file import load_rig
from tests.helpers.rig_lab import LINE, Bench, device_source

SECOND = 10**9


@pytest.fixture
def source(tmp_path):
    return device_source(tmp_path, LINE.format(first="time ns"))


def stamps(source, times, arrivals):
    """Stamps of lines with these device times [ns], less when they left the device."""
    list(source.take(Event(0, b"\n")))
    taken = [source.take(Event(arrival, b"%d 1\n" % time_)) for time_, arrival in zip(times, arrivals, strict=True)]
    return np.array([m.stamp - arrival for m, arrival in zip(itertools.chain(*taken), arrivals, strict=True)])


@pytest.mark.parametrize("absurd", [2**63, 10**300, 12 * SECOND, -(2**63), 0])
@pytest.mark.parametrize("place", [0, 3000])
def test_one_absurd_device_time_moves_no_other_stamp(source, absurd, place):
    source.parser._period = 1_000_000
    arrivals = SECOND + np.arange(5000) * 1_000_000
    times = [int(arrival) + 7 * SECOND for arrival in arrivals]
    times[place] = absurd
    off = stamps(source, times, arrivals.tolist())
    assert np.abs(off).max() < 1_000_000  # the time on the wire, and the half pace of a new clock
    assert source.clock_jumps in (1, 20)
    assert sum("clock jumps" in text for text in source.troubles) == 1
    assert source.counts.missing == 0


@pytest.mark.parametrize("step", [-4 * SECOND, 3600 * SECOND])
def test_a_device_clock_that_is_set_anew_is_followed_after_twenty_samples(source, step):
    source.parser._period = 1_000_000
    arrivals = 5 * SECOND + np.arange(6000) * 1_000_000
    times = arrivals + step * (np.arange(6000) >= 3000)
    late = np.random.default_rng(1).integers(0, 400_000, 6000)
    off = stamps(source, times.tolist(), (arrivals + late).tolist()) + late
    assert source.clock_jumps == 20
    assert source.counts.missing == 0  # a clock that is set ahead is no gap
    assert np.abs(off[3200:]).max() < 150_000
    assert np.abs(off).max() < 500_000


def test_late_arrivals_are_no_jumps(source):
    """Twenty seconds of samples that come all at once."""
    times = SECOND + np.arange(20_000) * 1_000_000
    arrivals = np.maximum(times, 21 * SECOND * (times > 2 * SECOND))
    stamps(source, times.tolist(), arrivals.tolist())
    assert source.clock_jumps == 0
    assert all("waited to be read" in text for text in source.troubles)


def test_stamps_of_eight_thousand_samples_a_second_never_step_back():
    """Where the fit falls by more than the distance of samples, as when a faster one arrives."""
    tracker = ClockTracker()
    device = np.arange(16_000) * 125_000
    arrival = np.maximum.accumulate(device + np.where(np.arange(16_000) < 8000, 2_000_000, 0))
    stamp = np.array([tracker.stamp(int(d), int(a)) for d, a in zip(device, arrival, strict=True)])
    assert (np.diff(stamp) > 0).all()
    assert (stamp <= arrival + 16).all()  # ns: one each of the samples that arrive at the same instant
    np.testing.assert_array_equal(stamp[8016:], device[8016:])


def test_a_recording_outlives_absurd_device_times_and_a_host_clock_that_is_set_back(tmp_path, monkeypatch):
    """Every hundredth sample of a device has a time that is far off; the host's calendar goes back by an hour."""
    seen = collections.defaultdict(itertools.count)  # by device, so that neither takes the other's turn

    def absurd(unwrap, raw):
        return raw + (10**14 if next(seen[id(unwrap)]) % 100 == 50 else 0)

    with Bench(tmp_path) as bench:
        recorder = Recorder(load_rig(bench.rig), tmp_path / "run.mcap")
        monkeypatch.setattr("rig.devices.xsens.Unwrapper.__call__", absurd)
        now = time.time_ns()
        earlier = lambda clock=time.time_ns: clock() - 3600 * SECOND  # noqa: E731
        threading.Timer(0.6, lambda: monkeypatch.setattr(time, "time_ns", earlier)).start()
        summary = recorder.run(1.2)
        monkeypatch.undo()
    run = runs.read(tmp_path / "run.mcap")
    jumps = sorted(device["clock_jumps"] for device in summary.devices.values())
    absurd_ones = sorted((next(n) + 49) // 100 for n in seen.values())
    assert min(jumps) >= 1
    assert all(
        n - 1 <= k <= n for k, n in zip(jumps, absurd_ones, strict=True)
    )  # the last sample may come after the end
    for channel in (run.wrench, run.imu):
        assert len(channel.stamp) > 60  # however slow the machine
        assert (np.diff(channel.log_time) >= 0).all()
        assert np.abs(channel.stamp - channel.log_time).max() < 2 * SECOND  # on a busy machine; the faults are hours
        assert abs(channel.log_time - now).max() < 60 * SECOND


def test_a_parser_that_gives_seconds_is_reported_and_its_samples_are_kept(source, monkeypatch):
    """As a device of another package may: ns as int are expected."""
    monkeypatch.setattr(type(source.parser), "samples", lambda _, frame: [Sample((1.0,), time=float(frame.split()[0]))])
    list(source.take(Event(0, b"\n")))
    arrivals = SECOND + np.arange(100) * 10_000_000
    taken = [m for k, at in enumerate(arrivals.tolist()) for m in source.take(Event(at, b"%f 1\n" % (0.01 * k)))]
    assert np.abs(np.array([m.stamp for m in taken]) - arrivals).max() < 1_000_000
    assert source.complete
    (text,) = source.troubles
    assert text.startswith("line: its kind 'line' gives times that are no int in ns")

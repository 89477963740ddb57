"""Stamps of a device that counts its samples and has no clock: against the instants at which they were taken."""

import itertools

import numpy as np
import pytest

from rig.record.reader import Event
from tests.helpers.rig_lab import LINE, device_source

SECOND = 10**9
PERIOD = 2_500_750  # ns: 400 Hz by a crystal that is 300 ppm slow
LEAST = 300_000  # ns that every sample takes at least
WIRE = 6_400  # ns of which these are known: 64 bytes on the wire


@pytest.fixture
def source(tmp_path):
    return device_source(tmp_path, LINE.format(first="counter"))


def errors(source, counters, instants, generator):
    """Stamp less instant less the least delay [ns], and arrival likewise; samples that share an arrival come at once."""
    late = generator.exponential(1_500_000, len(instants)).astype(np.int64)
    arrivals = np.maximum.accumulate(np.asarray(instants) + LEAST + late)
    list(source.take(Event(0, b"\n")))
    taken = [source.take(Event(int(a), b"%d 1\n" % c)) for c, a in zip(counters, arrivals, strict=True)]
    stamps = np.array([m.stamp for m in itertools.chain(*taken)])
    return stamps + WIRE - instants - LEAST, arrivals - instants - LEAST


def rms(values):
    return np.sqrt(np.mean(np.square(values.astype(float))))


@pytest.mark.parametrize(
    "width", [2**8, pytest.param(2**16, marks=pytest.mark.study), pytest.param(2**32, marks=pytest.mark.slow)]
)
def test_a_counter_stamps_thirty_times_better_than_arrivals(source, generator, width):
    """Three minutes and losses of up to a second; the counter wraps."""
    number = np.arange(71_900)
    lost = (number % 9000 > 8950) | ((number > 40_000) & (number < 40_400) & (width > 2**8))
    number = number[~lost]
    instants = SECOND + number * PERIOD
    of_stamps, of_arrivals = errors(source, (number + width - 500) % width, instants, generator)
    settled = instants > 5 * SECOND
    assert rms(of_arrivals[settled]) > 1_400_000
    assert rms(of_stamps[settled]) < 50_000
    assert source.counts.missing == lost.sum()
    facts = source.stamping
    assert facts["stamped_by"] == "counter"
    assert facts["counter_period_ns"] == pytest.approx(PERIOD, rel=2e-6)
    # what is stated of the fit bounds the error beyond the least delay, and is no excuse
    assert rms(of_stamps[settled]) < 1e3 * facts["stamp_uncertainty_us"] < 100_000
    assert source.troubles == []


def test_a_counter_that_starts_anew_is_followed(source, generator):
    number = np.arange(16_000)
    instants = SECOND + number * PERIOD + (number >= 8000) * 3 * SECOND
    of_stamps, _ = errors(source, np.where(number < 8000, number, number - 8000), instants, generator)
    assert rms(of_stamps[10_000:]) < 200_000
    assert np.abs(of_stamps).max() < 20_000_000
    assert source.stamping["stamped_by"] == "counter"


def test_a_counter_at_no_steady_rate_is_no_clock(source, generator):
    """A loop whose period wanders by a percent: arrivals are the better stamps, and the record says so."""
    wander = np.cumsum(generator.normal(0, 2e-4, 24_000))
    instants = SECOND + np.cumsum((PERIOD * (1 + np.clip(wander, -0.02, 0.02))).astype(np.int64))
    of_stamps, of_arrivals = errors(source, np.arange(24_000), instants, generator)
    assert source.stamping == {"stamped_by": "arrival"}
    (text,) = source.troubles
    assert "no steady rate: samples are stamped on arrival" in text
    late = instants > 20 * SECOND
    np.testing.assert_array_equal(of_stamps[late], of_arrivals[late])


def test_a_pause_of_the_host_is_no_unsteady_counter(source, generator):
    """Five seconds that arrive all at once."""
    number = np.arange(16_000)
    instants = SECOND + number * PERIOD
    held = (number > 4000) & (number < 6000)
    late = np.where(held, instants[6000] - instants, 0)
    arrivals = np.maximum.accumulate(instants + LEAST + late + generator.exponential(1_500_000, 16_000).astype(int))
    list(source.take(Event(0, b"\n")))
    stamps = [m.stamp for c, a in zip(number, arrivals, strict=True) for m in source.take(Event(int(a), b"%d 1\n" % c))]
    assert rms((np.array(stamps) - instants - LEAST)[2000:]) < 100_000
    assert source.stamping["stamped_by"] == "counter"


def test_a_device_without_clock_and_counter_is_stamped_by_arrival(tmp_path):
    source = device_source(tmp_path, LINE.format(first="_"))
    list(source.take(Event(0, b"\n")))
    (taken,) = source.take(Event(SECOND, b"1 2\n"))
    assert taken.stamp == SECOND - WIRE
    assert source.stamping == {"stamped_by": "arrival"}


def test_bytes_that_were_held_up_put_no_later_sample_before_an_earlier_one(tmp_path):
    """Robotiq, 8.3 ms a frame on the wire: a frame 30 ms late, then three at once, within 1 ms of it."""
    source = device_source(
        tmp_path, '[[device]]\nname = "d"\nkind = "robotiq-ft"\nport = "/dev/none"\nwrench = "on_sensor"\n'
    )
    emulator = source.entry.device.emulator(rate=100.0)
    frames = [emulator.frame(k, 0.01 * k, (0.0,) * 6) for k in range(8)]
    pieces = [
        (frames[0], 10),
        (frames[1], 20),
        (frames[2], 60),
        (b"".join(frames[3:6]), 61),
        (frames[6] + frames[7], 81),
    ]
    stamps = [m.stamp for data, ms in pieces for m in source.take(Event(ms * 1_000_000, data))]
    assert len(stamps) >= 7  # a frame may wait for the next one's head
    assert (np.diff(stamps) > 0).all(), stamps

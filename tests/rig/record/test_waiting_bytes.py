"""Starts of a recording whose port already holds bytes: no stamp is later than its arrival, and the clock is right.

Time is simulated: bytes reach the port at known instants, the reader takes them late, the recording begins some time
after the first sample.
"""

import numpy as np
import pytest

from rig.record.reader import Event
from tests.helpers.rig_lab import LINE, device_source

MS = 1_000_000
OPENED = 100_000 * MS
READ = 4095  # bytes that Linux gives at once
BOTA = '[[device]]\nname = "d"\nkind = "bota"\nport = "/dev/none"\nwrench = "on_body"\noptions = {{ rate = {rate} }}\n'
ROBOTIQ = '[[device]]\nname = "d"\nkind = "robotiq-ft"\nport = "/dev/none"\nwrench = "on_body"\n'
PLAIN = LINE.replace('"level m"]', '"level m"], rate = {rate}').replace("baudrate = 100000000", "")
RIGS = {
    "clock": BOTA,
    "clock, USB": PLAIN.replace("{first}", "time us"),
    "counter": PLAIN.replace("{first}", "counter"),
    "neither": PLAIN.replace("{first}", "_"),
    "neither, paced": ROBOTIQ,
}


def reads(arrived, generator, *, loaded):
    """Times of the reads [ns] and the index behind the last frame of each: everything that has arrived, or READ."""
    now, taken, size = OPENED, 0, 37
    while taken < len(arrived):
        ready = np.searchsorted(arrived, now, side="right")
        stop = min(max(ready, taken), taken + READ // size)
        if stop > taken:
            yield now, taken, stop
        taken, full = stop, stop < ready
        late = generator.exponential(20 * MS if loaded else 0.1 * MS) * (loaded or not full)
        now = int((now if full else max(now, arrived[min(taken, len(arrived) - 1)])) + 0.05 * MS + late)


def start(folder, kind, rate, waiting, generator, *, loaded):
    """Return stamps less arrivals, stamps less instants and steps of the stamps of five seconds [ns], and the source."""
    period = round(1e9 / rate)
    source = device_source(folder, RIGS[kind].format(rate=rate))
    emulator, numbers = source.entry.device.emulator(rate=float(rate)), len(source.entry.device.channels[0].signals)
    held = waiting // 37
    instants = OPENED - held * period + np.arange(held + 5 * rate) * period
    frames = [emulator.frame(k, k / rate, (1.0,) * numbers) for k in range(len(instants))]
    begins, began, rows = OPENED + (generator.exponential(30 * MS) if loaded else 2 * MS), False, []
    list(source.take(Event(0, b"\n")))
    for now, first, stop in reads(instants, generator, loaded=loaded):
        if rows and now > begins and not began:
            began, rows = True, []
            source.begin(int(begins))
        measured = list(source.take(Event(now, b"".join(frames[first:stop]))))
        # a frame may wait for the head of the next
        rows += [(m.stamp - m.arrival, m.stamp, now) for m in measured]
    after, stamps, _ = np.array(rows).T
    return after, stamps - instants[-len(stamps) :], np.diff(stamps), source


@pytest.mark.study
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("kind", RIGS)
def test_two_hundred_starts(tmp_path, generator, kind, loaded):
    """Of 0 to 4 kB that wait: errors of the stamps and what was said."""
    worst, errors, said = 0, [], 0
    for waiting in range(0, 4000, 20):
        after, error, steps, source = start(tmp_path, kind, 100, waiting, generator, loaded=loaded)
        assert steps.min() > 0
        worst = max(worst, after.max())
        errors += [np.abs(error).max(), np.abs(np.median(error))]
        said += bool(source.troubles)
    print(
        f"{kind}, {'loaded' if loaded else 'quiet'}: latest stamp {worst / MS:.3f} ms after its arrival; largest error "
        f"{max(errors[::2]) / MS:.1f} ms, in the median start {np.median(errors[::2]) / MS:.1f} ms; median error "
        f"{np.median(errors[1::2]) / MS:.2f} ms; a message in {said} of 200"
    )
    assert worst <= 0


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("kind", RIGS)
def test_no_stamp_is_later_than_its_arrival(tmp_path, generator, kind, loaded):
    for rate, waiting in ((100, 4095), (100, 40), (800, 4000))[: 2 if kind == "neither, paced" else 3]:
        after, _, steps, source = start(tmp_path, kind, rate, waiting, generator, loaded=loaded)
        assert after.max() <= 0, f"{after.max() / MS:.3f} ms after arrival"
        assert steps.min() > 0
        assert source.troubles == []


def test_late_stamps_are_reported_once(tmp_path):
    """A read 90 ms late, then what came meanwhile, one by one: no stamp is later than it arrived, and all are soon right."""
    source = device_source(tmp_path, RIGS["clock"].format(rate=50))
    emulator = source.entry.device.emulator(rate=50.0)
    frames = [emulator.frame(k, 0.02 * k, (1.0,) * 6) for k in range(100)]
    arrivals = [OPENED + max(90, 20 * k) * MS + k for k in range(100)]
    rows = [m for frame, at in zip(frames, arrivals, strict=True) for m in source.take(Event(at, frame))]
    stamps = np.array([m.stamp for m in rows])
    assert (stamps <= arrivals).all()
    assert (np.diff(stamps) > 0).all()
    np.testing.assert_allclose(stamps[6:], np.array(arrivals[6:]), rtol=0, atol=MS)
    (text,) = source.troubles
    assert text.startswith("d: stamps until here are late by 10 ms or more: its bytes waited to be read, or")


def test_a_clock_that_is_off_by_a_percent_is_no_late_read(tmp_path):
    """As a ceramic resonator: when the skew is known, after two seconds, the line moves by 20 ms."""
    source = device_source(tmp_path, RIGS["clock"].format(rate=50))
    emulator = source.entry.device.emulator(rate=50.0)
    for k in range(300):
        list(source.take(Event(OPENED + 20 * MS * k, emulator.frame(k, 0.0202 * k, (1.0,) * 6))))
    assert source.troubles == []

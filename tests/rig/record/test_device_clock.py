"""Clock fit and delay against closed forms; what a source makes of arrivals; the terminal; a reader that fails."""

import io
import os
import pty
import threading
import time
from collections import deque

import numpy as np
import pytest

from rig import runs
from rig.devices import bota
from rig.devices.conversation import Identity
from rig.exceptions import RigError
from rig.record import command_delay, device_clock
from rig.record.device_source import DeviceSource
from rig.record.live_values import describe
from rig.record.reader import LIMIT, Event, Reader
from rig.record.recorder import Progress, Recorder
from rig.record.rig_file import load_rig
from rig.record.session import Session
from rig.record.terminal import Keys, Terminal
from tests.helpers.rig_lab import LINE, Bench, device_source

RIG = '[[device]]\nname = "cell"\nkind = "bota"\nport = "/dev/none"\nwrench = "on_sensor"\n'


@pytest.fixture
def entry(tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    return load_rig(tmp_path / "rig.toml").entries[0]


@pytest.mark.parametrize("skew", [0.0, 50e-6, -200e-6])
def test_the_clock_fit_is_exact_without_delays(skew):
    device = np.arange(0, 20_000_000_000, 1_000_000)
    arrival = device + 7_000_000 + np.round(skew * device).astype(np.int64)
    fit = device_clock.fit(device, arrival)
    # rounding to 1 ns over at least half of 20 s: 1e-10
    assert fit.skew == pytest.approx(skew, abs=2e-10)
    assert fit.host(10_000_000_000) == pytest.approx(10_007_000_000 + skew * 1e10, abs=3)


def test_delays_do_not_bias_the_clock_fit():
    """Delays of up to 1 ms as from a USB timer: the hull keeps the skew within 1 ppm, where the mean is 0.5 ms late."""
    draw = np.random.default_rng(1)
    device = np.arange(0, 60_000_000_000, 1_000_000)
    late = draw.uniform(0, 1e6, len(device)).astype(np.int64)
    fit = device_clock.fit(device, device + 3_000_000 + np.round(20e-6 * device).astype(np.int64) + late)
    assert fit.skew == pytest.approx(20e-6, abs=1e-6)
    assert fit.offset == pytest.approx(3_000_000, abs=20_000)


def test_over_a_short_time_the_skew_is_taken_as_zero():
    device = np.arange(0, 1_000_000_000, 1_000_000)
    fit = device_clock.fit(device, device + 500 + (device % 7))
    assert (fit.skew, fit.offset) == (0.0, 500)
    assert device_clock.fit(device[:0], device[:0]) == (0.0, 0.0, 0)


@pytest.mark.parametrize("late", [1, 3, 10**6, 10**12, 10**17])
@pytest.mark.parametrize("back", [0, 3])
def test_the_fit_of_a_run_is_the_tracker_s_to_the_last_bit(late, back):
    """The points that it leaves out are no corners; times that go back, ties and delays near overflow included."""
    draw = np.random.default_rng(3)
    for count in [*range(8), *draw.integers(8, 200, 40)]:
        device = np.cumsum(draw.integers(-back, 9, count) * 10**8)
        arrival = device + draw.integers(0, late, count)
        tracker = device_clock.ClockTracker()
        for pair in zip(device.tolist(), arrival.tolist(), strict=True):
            tracker.add(*pair)
        assert device_clock.fit(device, arrival) == tracker.fit


@pytest.mark.parametrize("shift", [-0.2137, 0.0, 0.0213, 0.3])
def test_a_delay_is_found(shift):
    t, u = np.arange(0, 8, 0.005), np.arange(0.013, 8, 0.002)

    def wave(time_):
        return np.sin(2 * np.pi * 0.7 * time_) + 0.5 * np.sin(2 * np.pi * 1.9 * time_ + 1)

    found = command_delay.estimate(t, wave(t), u, wave(u - shift))
    # linear interpolation at 5 ms of a 1.9 Hz wave errs by at most (2 pi 1.9 0.005)^2 / 8 = 0.05 % of it
    assert found.seconds == pytest.approx(shift, abs=1e-4)
    assert found.correlation > 0.999


def test_a_delay_that_cannot_be_told_is_none():
    t = np.arange(0, 8, 0.005)
    noise = np.random.default_rng(2).normal(size=(2, len(t)))
    assert command_delay.estimate(t, noise[0], t, noise[1]) is None  # coefficient 0.7 by chance: below 1e-100
    assert command_delay.estimate(t[:100], noise[0, :100], t[:100], noise[0, :100]) is None
    assert command_delay.estimate(t, 0 * t, t, np.sin(t)) is None
    assert command_delay.of_command(("stroke",), deque(), deque()) is None
    absurd = deque((round(1e9 * s), (1e200 * x,) * 3) for s, x in zip(t, noise[0], strict=True))
    assert command_delay.of_command(("omega_x", "omega_y"), absurd, absurd) is None


def test_a_source_turns_to_the_body_frame_stamps_and_counts(entry):
    source = DeviceSource(entry, Reader(entry, "/dev/none"), now=0)
    byte_time = 10e9 / 460800
    frames = [bota.encode((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), microseconds=1250 * i) for i in (0, 1, 3)]
    got = list(source.take(Event(10**9, b"".join(frames))))
    assert [m.values for m in got] == [(-1.0, -2.0, -3.0, -4.0, -5.0, -6.0)] * 3
    assert [m.sequence for m in got] == [0, 1, 3]
    assert source.counts.missing == 1
    assert not source.complete
    # they waited for one another: the last one least, but for its time on the wire
    assert got[2].stamp == pytest.approx(10**9 - 37 * byte_time, abs=2)
    assert np.diff([m.stamp for m in got]).tolist() == [1_250_000, 2_500_000]


def test_a_source_turns_by_the_rotation_of_the_rig_file(tmp_path):
    (tmp_path / "rig.toml").write_text(RIG + "rotation_to_body = [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]\n")
    entry = load_rig(tmp_path / "rig.toml").entries[0]
    source = DeviceSource(entry, Reader(entry, "/dev/none"), now=0)
    frame = bota.encode((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), microseconds=0)
    (got,) = source.take(Event(1, frame))
    assert got.values == (2.0, -3.0, 1.0, 5.0, -6.0, 4.0)  # minus the rotated: the reading is the wrench on the sensor


def test_a_source_tells_how_it_fares_and_counts_over_reconnections(entry):
    source = DeviceSource(entry, Reader(entry, "/dev/none"), now=0)
    frame = bota.encode((0.0,) * 6, microseconds=5)
    list(source.take(Event(1, frame)))
    source.look(3 * 10**9)
    assert source.state == "silent"
    list(source.take(Event(4 * 10**9, lost=True)))
    assert source.state == "unplugged"
    list(source.take(Event(5 * 10**9, answered=Identity(model="again"))))
    list(source.take(Event(6 * 10**9, frame)))
    assert (source.state, source.reconnects, source.counts.samples) == ("ok", 1, 2)
    assert source.downtime == 6 * 10**9 - 1
    assert len(source.troubles) == 3
    list(source.take(Event(7 * 10**9, bytes(3000))))
    source.look(9 * 10**9)
    assert source.state == "babbling"


def test_silence_just_before_the_end_is_missing_data(entry):
    source = DeviceSource(entry, Reader(entry, "/dev/none"), now=0)
    list(source.take(Event(10**9, bota.encode((0.0,) * 6, microseconds=5))))
    source.look(10**9 + 900_000_000)
    assert source.state == "ok"
    source.finish(10**9 + 900_000_000)
    assert (source.state, source.complete) == ("silent", False)


class EndlessPort:
    """A port that never runs dry."""

    def read(self):
        return bytes(65536)

    def write(self, data):
        """Nobody listens."""

    def close(self):
        """Nothing to close."""


class BrokenPort(EndlessPort):
    """A port whose driver has a bug."""

    def read(self):
        raise ZeroDivisionError("a bug")


def running(entry, port, monkeypatch):
    monkeypatch.setattr("rig.record.reader.open_port", lambda *_: port)
    monkeypatch.setattr("rig.record.reader.converse", lambda *_: Identity())
    reader = Reader(entry, "/dev/none")
    reader.start()
    return reader


def test_a_queue_that_nobody_empties_is_bounded_and_the_loss_is_counted(entry, monkeypatch):
    reader = running(entry, EndlessPort(), monkeypatch)
    while not reader.overflow:
        time.sleep(0.01)
    reader.halt()
    reader.join()
    assert sum(len(event.data) for event in reader.events) <= LIMIT + 65536
    source = DeviceSource(entry, reader, now=0)
    assert not source.complete


def test_an_exception_in_a_reader_ends_the_session_loudly(entry, monkeypatch, tmp_path):
    reader = running(entry, BrokenPort(), monkeypatch)
    reader.join()
    session = Session(load_rig(tmp_path / "rig.toml"))
    session._readers = [reader]
    with pytest.raises(RigError, match=r"reader of cell failed .*a bug"):
        session.raise_failures()


def test_a_recording_whose_reader_fails_is_ended_loudly_and_kept(tmp_path, monkeypatch):
    with Bench(tmp_path) as bench:
        recorder = Recorder(load_rig(bench.rig), tmp_path / "run.mcap")
        broken = threading.Timer(1.2, lambda: monkeypatch.setattr("rig.record.port.os.read", lambda *_: 1 / 0))
        broken.start()
        with pytest.raises(RigError, match=r"reader of .* failed .*what was recorded until then is in"):
            recorder.run()
        monkeypatch.undo()
    assert len(runs.read(tmp_path / "run.mcap").wrench.stamp) > 100


def test_the_terminal_shows_rates_losses_time_and_size(entry):
    source = DeviceSource(entry, Reader(entry, "/dev/none"), now=0)
    list(source.take(Event(1, b"".join(bota.encode((0.0,) * 6, microseconds=1250 * i) for i in range(800)))))
    text = Terminal(io.StringIO()).line(Progress(1.0, 2_500_000, [source]))
    assert text == "    1.0 s  2.5 MB  |  cell 800 Hz, 0 missing, 0 bad"
    source.look(10**10)
    assert "SILENT" in Terminal(io.StringIO()).line(Progress(1.0, 2_500_000, [source]))


def test_a_key_on_a_terminal_is_a_mark(monkeypatch):
    master, slave = pty.openpty()
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
    heard = []
    with os.fdopen(slave) as stream, Keys(stream, heard.append):
        os.write(master, b"m")
        deadline = time.monotonic() + 30
        while not heard and time.monotonic() < deadline:
            time.sleep(0.01)
    os.close(master)
    assert heard == ["m"]


def arrivals(source, rate):
    """Two seconds of lines of 80 bytes with their time, in packets of ten that are there at once, as USB brings them."""
    lines = [f"{round(1e6 * k / rate)},{k:{80 - 2 - len(str(round(1e6 * k / rate)))}}\n" for k in range(2 * rate)]
    for k in range(0, len(lines), 10):
        yield from source.take(Event(10**9 + round(1e9 * (k + 9) / rate), "".join(lines[k : k + 10]).encode()))


@pytest.mark.parametrize("stated", [True, False])
def test_what_is_faster_than_its_baud_rate_has_none(tmp_path, stated):
    """500 lines of 80 bytes a second are four times what 115200 baud carry; by it, the first came 62 ms too early."""
    text = LINE.format(first="time us").replace("baudrate = 100000000", "baudrate = 115200" * stated)
    source = device_source(tmp_path, text.replace('"level m"]', '"level m"], separator = ","'))
    stamps = np.array([m.stamp for m in arrivals(source, 500)])
    late = stamps - 10**9 - 2_000_000 * np.arange(1, 1 + len(stamps))
    assert np.abs(late[-200:]).max() < 1_000_000
    assert source.clock_jumps == 0
    assert [text for text in source.troubles if "115200 baud" in text] == source.troubles
    assert len(source.troubles) == stated


@pytest.mark.parametrize("kind", ["bota", "xsens"])
def test_absurd_readings_are_shown_without_a_warning(tmp_path, kind):
    """Warnings are errors here."""
    sign = 'wrench = "on_body"' if kind == "bota" else ""
    source = device_source(tmp_path, f'[[device]]\nname = "d"\nkind = "{kind}"\nport = "/dev/none"\n{sign}\n')
    assert describe(source, [(1e308,) * 6, (1.7e308,) * 6, (-1e308,) * 6], 1.0).startswith("d: 3 Hz, 0 missing, 0 bad")

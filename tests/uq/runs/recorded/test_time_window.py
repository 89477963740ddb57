"""``--from`` and ``--to``, marks, and samples that a sensor did not really take."""

import dataclasses
import struct

import numpy as np
import pytest

import rig
from identify.signals.held_samples import held, repeats, saturated
from identify.signals.run import Run, RunError
from rig.bags import marks
from rig.channels import ImuChannel, WrenchChannel
from rig.mcap import cdr
from rig.mcap.message_definitions import DIAGNOSTICS, TEXT
from rig.mcap.writer import new_writer, register
from tests.helpers.commands import refused
from tests.helpers.recordings import Signals, declare, write
from uq.cli.main import main
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load_run
from uq.runs.recorded.message_times import instants
from uq.runs.recorded.time_window import TimeWindow, resolve, windows_of_options

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

MARKS = [(1.0, "start"), (5.0, "end"), (7.0, "twice"), (8.0, "twice")]


@pytest.mark.parametrize(
    ("limits", "parts"),
    [
        ([], ()),
        ([("from", "2")], [TimeWindow(2.0)]),
        ([("to", "go")], [TimeWindow(None, "go")]),
        ([("from", "1"), ("to", "2"), ("from", "go"), ("to", "8")], [TimeWindow(1.0, 2.0), TimeWindow("go", 8.0)]),
        ([("to", "2"), ("from", "5")], [TimeWindow(None, 2.0), TimeWindow(5.0, None)]),
        ([("from", "1"), ("from", "5"), ("to", "6")], [TimeWindow(1.0, None), TimeWindow(5.0, 6.0)]),
    ],
)
def test_limits_become_parts_in_their_order(limits, parts):
    assert windows_of_options(limits) == tuple(parts)


def test_parts_in_seconds():
    found = resolve([TimeWindow("end", None), TimeWindow(0.5, "start")], 10.0, MARKS, "run")
    assert found == ((0.5, 1.0), (5.0, 10.0))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ([TimeWindow("go")], r"no mark 'go' in run for --from: give seconds or one of its marks \(end, start, twice\)"),
        ([TimeWindow(None, "twice")], "2 marks 'twice' in run for --to: give seconds instead"),
        ([TimeWindow(11.0)], "--from 11 s is outside run, which lasts 10 s"),
        ([TimeWindow(-1.0)], "--from -1 s is outside run"),
        ([TimeWindow(None, float("nan"))], "--to nan s is outside run"),
        ([TimeWindow(float("inf"))], "--from inf s is outside run"),
        ([TimeWindow("end", "start")], "the part from 5 to 1 s of run is empty or reversed: give --to after --from"),
        ([TimeWindow(3.0, 3.0)], "the part from 3 to 3 s of run is empty"),
        ([TimeWindow(1.0, 4.0), TimeWindow(3.0, 6.0)], "two parts of run overlap from 3 to 4 s"),
    ],
)
def test_a_part_that_cannot_be_is_refused_in_one_line(parts, words):
    with pytest.raises(RunError, match=words) as caught:
        resolve(parts, 10.0, MARKS, "run")
    assert "\n" not in str(caught.value)


def test_a_part_with_too_few_samples():
    t = np.arange(100) / 100
    run = Run.from_arrays(t, *np.ones((3, 100, 3)))
    with pytest.raises(RunError, match=r"fewer than two samples in run between 0\.101 and 0\.105 s"):
        run.within([(0.3, 0.5), (0.101, 0.105)])
    cut = run.within([(0.6, 0.8), (0.3, 0.5)])
    assert cut.segments == ((0.3, 0.5), (0.6, 0.8))
    assert [part.stop - part.start for part in cut.used()] == [21, 21]
    assert cut.left_out == {"outside the part": 58}


# Marks and status of a recorder.


@pytest.fixture(scope="module")
def marked(short, tmp_path_factory):
    """A run with two marks, its stamps on a clock of their own, and a load cell out of range for a second."""
    path = tmp_path_factory.mktemp("marked") / "run.mcap"
    signals = Signals.of(simulate(short, "T1"))
    write(path, signals)
    return path, signals


def with_notes(path, signals, *, marks, flagged=(), apart=0):
    """Write the run with notes beside its samples; ``apart`` is the log's clock less the stamps' [ns]."""
    from rig.mcap import cdr
    from rig.mcap.message_definitions import IMU, WRENCH
    from rig.mcap.records import seal

    stamp = np.round(signals.t * 1e9).astype(np.int64)
    facts = {"wrench": "on_body", "log_time": "arrival", "cell.topic": "/wrench"}
    with open(path, "wb") as stream:
        writer = new_writer(stream)
        writer.add_metadata("rig.run", seal("rig.run", facts))
        ids = [register(writer, kind, topic) for kind, topic in
               ((WRENCH, "/wrench"), (IMU, "/imu"), (TEXT, "/mark"), (DIAGNOSTICS, "/diagnostics"))]  # fmt: skip
        wrench, imu = cdr.encoder(WRENCH, "cell"), cdr.encoder(IMU, "imu")
        rows = zip(stamp.tolist(), np.hstack([signals.force, signals.moment]).tolist(),
                   np.hstack([signals.omega, signals.specific_force]).tolist(), strict=True)  # fmt: skip
        for k, (time, of_wrench, of_imu) in enumerate(rows):
            writer.add_message(ids[0], time + apart, wrench(time, of_wrench), time, k)
            writer.add_message(ids[1], time + apart, imu(time, of_imu), time, k)
        for seconds, name in marks:
            time = round(seconds * 1e9) + apart
            writer.add_message(ids[2], time, cdr.encode_text(name), time, 0)
        for seconds, count in flagged:
            time = round(seconds * 1e9) + apart
            status = cdr.encode_diagnostics(time, [(0, "cell", "ok", {"samples": 1, "flagged": count})])
            writer.add_message(ids[3], time, status, time, 0)
        writer.finish()
    return path


@pytest.mark.parametrize("apart", [0, 10**15])
def test_a_part_between_marks(short, tmp_path, marked, apart, capsys):
    path = with_notes(tmp_path / "m.mcap", marked[1], marks=[(2.0, "go ω"), (17.5, "end")], apart=apart)
    by_name = identify_files([path], declare(short), windows=[TimeWindow("go ω", "end")])
    by_time = identify_files([path], declare(short), windows=[TimeWindow(2.0, 17.5)])
    np.testing.assert_array_equal(by_name.inertia, by_time.inertia)
    assert by_name.runs[0].segments == ((2.0, 17.5),)


def test_the_command_takes_parts(short, tmp_path, marked, capsys):
    path = with_notes(tmp_path / "m.mcap", marked[1], marks=[(2.0, "go"), (17.5, "end")])
    command = ["identify", str(path), "--experiment", "barreto2016"]
    assert main([*command, "--from", "go", "--to", "8.5", "--from", "9.5", "--to", "end", "--offsets", "none"]) == 0
    said = capsys.readouterr().out
    assert "m.mcap: used from 2.00 to 8.50 s and 9.50 to 17.50 s; left out: 2,098 samples outside the part" in said
    assert "assumed: force and moment are free of constant offsets beyond those declared" in said
    assert "no mark 'stop' in m.mcap for --to" in refused(capsys, *command, "--to", "stop")
    assert "empty or reversed" in refused(capsys, *command, "--from", "9", "--to", "3")
    assert "invalid choice: 'maybe'" in refused(capsys, *command, "--offsets", "maybe")


@pytest.mark.study
def test_the_report_draws_the_part_that_counts(tmp_path, marked):
    path = with_notes(tmp_path / "m.mcap", marked[1], marks=[])
    assert main(["identify", str(path), "--experiment", "barreto2016", "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "parts.svg").exists()
    assert "used from 0.59 to" in (tmp_path / "out" / "report.html").read_text()


def test_samples_of_a_second_out_of_range_are_left_out_and_counted(short, tmp_path, marked):
    signals = marked[1]
    flagged = [(4.0, 0), (5.0, 0), (6.0, 12), (7.0, 12)]
    path = with_notes(tmp_path / "f.mcap", signals, marks=[], flagged=flagged)
    spoilt = signals.force.copy()
    spoilt[2050:2060] += 500
    hurt = Signals(signals.t, spoilt, signals.moment, signals.omega, signals.specific_force)
    hurt_path = with_notes(tmp_path / "h.mcap", hurt, marks=[], flagged=flagged)
    results = [identify_files([one], declare(short)) for one in (path, hurt_path)]
    np.testing.assert_allclose(results[0].inertia, results[1].inertia, rtol=1e-12)
    assert results[0].runs[0].left_out["overrange"] == 400
    assert "400 samples overrange" in repr(results[0])


def test_marks_in_both_byte_orders_and_what_is_no_mark():
    big = b"\0\0\0\0" + struct.pack(">I", 3) + b"go\0"
    assert marks._Reader(big).text() == "go"
    assert marks._Reader(cdr.encode_text("gö")).text() == "gö"
    with pytest.raises(ValueError, match="not plain CDR"):
        marks._Reader(b"\0\7\0\0")


# Samples that were not really taken.


def test_a_slower_source_behind_faster_messages_is_found(generator):
    slow = generator.normal(size=(500, 6)).cumsum(axis=0)
    drop, frozen = repeats(np.repeat(slow, 4, axis=0))
    np.testing.assert_array_equal(~drop, np.arange(2000) % 4 == 0)
    assert not frozen.any()


def test_a_frozen_sensor_is_found_and_rest_is_not(generator):
    values = generator.normal(size=(1000, 6))
    values[300:340] = values[300]
    drop, frozen = repeats(values)
    assert not drop.any()
    assert np.flatnonzero(frozen).tolist() == list(range(300, 340))
    t = np.linspace(0, 1, 1000)
    smooth = np.where(t > 0.5, (t - 0.5) ** 4, 0.0)[:, None] * np.ones(6)  # a simulation without noise, first at rest
    assert not held(smooth).any()
    assert not held(np.ones((100, 3))).any()


def test_clipping_is_found_and_a_smooth_extreme_is_not(generator):
    t = np.arange(2000) / 400
    wave = np.sin(2 * np.pi * t)[:, None] * [1.0, 2.0, 3.0]
    assert not saturated(wave).any()
    clipped = saturated(np.clip(wave, -10, 2.5))
    np.testing.assert_array_equal(clipped, wave[:, 2] >= 2.5)
    rest = np.concatenate([np.ones((300, 3)), np.cos(np.linspace(0, 6, 900) ** 2)[:, None] * np.ones(3)])
    assert not saturated(rest).any()


def test_a_held_imu_and_a_clipped_cell_are_counted(short, tmp_path, marked):
    """The IMU's 100 Hz in messages at 400 Hz; the load cell clips at a limit that the moment reaches at times."""
    signals = marked[1]
    held_omega = np.repeat(signals.omega[::4], 4, axis=0)
    held_force = np.repeat(signals.specific_force[::4], 4, axis=0)
    moment = np.clip(np.round(signals.moment, 6), -9.0, 9.0)
    moment[3000:3012, 0] = 9.0
    run = Signals(signals.t, signals.force, moment, held_omega, held_force)
    result = identify_files([write(tmp_path / "held.mcap", run)], declare(short))
    plain = identify_files([write(tmp_path / "plain.mcap", signals, every=4)], declare(short))
    left_out = result.runs[0].left_out
    assert left_out["held"] == 5925
    assert left_out["saturated"] == 12
    assert result.runs[0].rate == pytest.approx(100)
    # Left out are 0.4 s of 18.6: the estimate moves by a part of its own uncertainty.
    np.testing.assert_allclose(result.inertia, plain.inertia, atol=0.5 * plain.standard_uncertainty.max())
    whole = dataclasses.replace(run, moment=signals.moment)
    again = identify_files([write(tmp_path / "whole.mcap", whole)], declare(short))
    np.testing.assert_array_equal(again.inertia, plain.inertia)


# Clocks.


def channel(stamp, log_time, sequence=None):
    zeros = np.zeros((len(stamp), 3))
    return ImuChannel("/x", "", np.asarray(log_time), np.asarray(stamp), zeros, zeros, sequence)


def test_a_run_that_starts_at_zero_has_stamps_all_the_same():
    stamp = np.arange(1000) * 1_000_000
    (first, _), said = instants((channel(stamp, stamp + 10**18), channel(stamp, stamp + 10**18)), None)
    np.testing.assert_array_equal(first, stamp)
    assert said == ()


def test_stamps_that_do_not_increase_give_way_to_the_log():
    stamp = np.arange(1000) * 1_000_000
    wild = stamp.copy()
    wild[500] -= 5_000_000
    log = stamp + 10**18
    (first, second), said = instants((channel(stamp, log), channel(wild, log)), None)
    np.testing.assert_array_equal(first, log)
    np.testing.assert_array_equal(second, log)
    assert said == ("the headers' stamps of /x do not increase: the log's times are used for both sensors",)
    assert instants((channel(stamp, log), channel(wild, log)), "header")[0][1] is not log
    assert instants((channel(stamp, log), channel(stamp, log)), "log")[0][0][0] == log[0]
    assert instants((channel(stamp, log), channel(stamp, log)), "log")[1] == ()


def test_a_run_whose_messages_overtook_each_other_is_the_run_in_order(short, tmp_path, marked):
    """The same samples written in another order of arrival: the same tensor, and it is said."""
    path = write(tmp_path / "run.mcap", marked[1])
    recording = rig.read(path)
    late = np.zeros(len(recording.wrench.stamp), np.int64)
    late[100:3000:97] = 3 * int(1e9 / 400)
    order = np.argsort(recording.wrench.log_time + late, kind="stable")
    arrays = {name: getattr(recording.wrench, name)[order] for name in ("stamp", "force", "moment")}
    shuffled = dataclasses.replace(
        recording.wrench, log_time=(recording.wrench.log_time + late)[order], sequence=None, **arrays
    )
    other = tmp_path / "other.mcap"
    rig.write(other, wrench=shuffled, imu=recording.imu)
    assert (np.diff(rig.read(other).wrench.stamp) < 0).any()
    plain, again = (identify_files([file], declare(short)) for file in (path, other))
    np.testing.assert_array_equal(again.inertia, plain.inertia)
    assert any("overtook each other" in text for text in again.assumptions)
    by_log = identify_files([other], declare(short, time="log"))
    assert not any("overtook each other" in text for text in by_log.assumptions)


@pytest.mark.parametrize("counted", [True, False])
def test_lost_messages_leave_a_gap_and_a_stall_does_not(generator, counted):
    """1 kHz, 2 ms of jitter: forty messages lost at 4 s; a stall of 30 ms at 7 s, after which all come at once."""
    number = np.concatenate([np.arange(4000), np.arange(4040, 10000)])
    true = number * 1_000_000 + 10**18
    log = np.sort(true + generator.integers(0, 2_000_000, len(true)))
    stalled = (log > 10**18 + 7 * 10**9) & (log < 10**18 + 7.03 * 10**9)
    log[stalled] = 10**18 + 7_030_000_000 + np.arange(stalled.sum())
    counter = number.astype(np.uint32) if counted else np.zeros(len(number), np.uint32)
    bare = channel(np.zeros_like(log), log, counter)
    (found, _), said = instants((bare, bare), None)
    assert np.abs(found - true).max() < 200_000  # ns: the least delay of 2 ms, and a skew of less than 1e-5
    assert "jitter by" in said[1]


def test_a_clock_of_its_own_is_brought_to_the_log(generator):
    stamp = np.arange(20000) * 500_000
    log = 10**18 + np.round(stamp * (1 + 40e-6)).astype(np.int64) + generator.integers(0, 1_000_000, len(stamp))
    bare = channel(np.zeros_like(stamp), log, None)
    (found, _), _ = instants((channel(stamp, log), bare), None)
    assert np.abs(found - 10**18 - stamp * (1 + 40e-6)).max() < 20_000


def test_the_declared_clock_is_taken_whatever_it_says(short, tmp_path, marked):
    """Stamps that run backwards: the log's times without the key, a refusal with it."""
    signals = marked[1]
    wild = signals.t.copy()
    wild[4000:] -= 0.1
    run = Signals(wild, signals.force, signals.moment, signals.omega, signals.specific_force)
    path = write(tmp_path / "wild.mcap", run, late=np.zeros(len(wild)))
    with pytest.raises(RunError, match=r"time of the wrench in wild\.mcap runs backwards at sample 4000"):
        identify_files([path], declare(short, time="header"))


def test_a_clock_that_mostly_stands_still_is_refused(short, tmp_path, marked):
    """Half of its intervals are zero, so that it has no rate."""
    signals = marked[1]
    path = write(tmp_path / "halts.mcap", dataclasses.replace(signals, t=np.where(signals.t > signals.t[-9], 1.0, 0.0)))
    with pytest.raises(RunError, match=r"time of the wrench in halts\.mcap stands still at sample 1 "):
        identify_files([path], declare(short))


@pytest.mark.parametrize(("choice", "which"), [("header", "stamps"), ("log", "log times"), (None, "log times")])
def test_a_clock_that_stands_still_is_refused(choice, which):
    """Neither the headers' times nor, in their place, the log's; where one of the two runs, it is taken."""
    runs, still, zero = 10 * np.arange(20), np.full(20, 7), np.zeros((20, 3))
    wrench, stopped = (WrenchChannel("/wrench", "cell", times, times, zero, zero) for times in (runs, still))
    with pytest.raises(RunError, match=f"^all {which} of /wrench are the same: record it with a running clock$"):
        instants((stopped, stopped), choice)
    halted = dataclasses.replace(wrench, **{"log_time" if choice == "header" else "stamp": still})
    np.testing.assert_array_equal(instants((halted, halted), choice)[0][0], runs)


UNUSABLE = {
    "force and moment in run.mcap never change: check load cell and driver": {"force": 0.0, "moment": 0.0},
    "wrench in run.mcap is at most .*e-19.: correct its unit or scale": {"force": 1e-200, "moment": 1e-200},
    "wrench in run.mcap is .*e.30. at sample .*: no sensor reads so much": {"force": 1e304},
    "time of the wrench in run.mcap jumps by 1e.07 s at 2 s: use the other clock or record again": {"t": 1e7},
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("message", UNUSABLE)
def test_readings_of_no_sensor_are_refused(message, short, tmp_path, marked):
    """Before anything is computed of them, so that NumPy has nothing to warn of."""
    signals = marked[1]
    changed = {name: getattr(signals, name) * factor for name, factor in UNUSABLE[message].items() if name != "t"}
    if "t" in UNUSABLE[message]:
        changed["t"] = signals.t + UNUSABLE[message]["t"] * (signals.t > 2)
    path = write(tmp_path / "run.mcap", dataclasses.replace(signals, **changed))
    with pytest.raises(RunError, match=message):
        load_run(path, declare(short, force_unit="kN").recording)

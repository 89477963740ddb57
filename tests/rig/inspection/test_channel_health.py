"""``rig.inspect`` looks at the health of channels and leaves what their values mean to who knows."""

from dataclasses import replace

import numpy as np
import pytest

import rig
from rig.inspection.channel_health import TopicFinding, channel_findings
from rig.record import device_clock
from tests.helpers.rig_samples import imu_channel, wrench_channel


def test_health_alone_says_nothing_of_units(tmp_path):
    imu = imu_channel(400)
    object.__setattr__(imu, "linear_acceleration", imu.linear_acceleration / 9.80665)
    rig.write(tmp_path / "run.mcap", wrench=wrench_channel(400), imu=imu)
    assert not {"unit", "axes", "sign"} & {finding.kind for finding in rig.inspect(tmp_path / "run.mcap").findings}


def test_a_judge_adds_what_it_knows(tmp_path):
    rig.write(tmp_path / "run.mcap", wrench=wrench_channel(400), imu=imu_channel(400))
    verdict = TopicFinding("mass", "/wrench", "too light")

    def judge(channels, findings):
        assert [channel.topic for channel in channels] == ["/imu", "/wrench"]
        np.testing.assert_array_equal(channels[1].force, wrench_channel(400).force)
        return [*findings, verdict]

    assert verdict in rig.inspect(tmp_path / "run.mcap", judge=judge).findings


@pytest.mark.parametrize(("stamped", "words"), [(True, "2 header stamps do not"), (False, "2 log times do not")])
def test_times_that_do_not_increase_are_called_by_their_name(stamped, words):
    channel = wrench_channel(400)
    stamp = channel.stamp.copy()
    stamp[[7, 20]] = stamp[[6, 19]]
    channel = replace(channel, stamp=stamp, log_time=channel.log_time if stamped else stamp)
    said = [finding.text for finding in channel_findings(channel, 0.0) if finding.kind == "order"]
    assert [text[: len(words)] for text in said] == [words]


def bursts(n=2000, *, period=2_000_000, every=20, lost=0):
    """A load cell of 500 Hz whose samples wait and come twenty at a time, 0.1 ms apart; ``lost`` ones at the middle."""
    number = np.arange(n) + lost * (np.arange(n) >= n // 2)
    turn = number % every
    arrival = 10**18 + (number - turn + every) * period + 100_000 * turn
    return replace(wrench_channel(n), stamp=arrival, log_time=arrival, sequence=None)


@pytest.mark.parametrize(("lost", "gaps"), [(0, 0), (100, 1)])
def test_samples_that_come_in_bursts_are_late_and_not_lost(lost, gaps):
    said = [finding.text for finding in channel_findings(bursts(lost=lost), 0.0) if finding.kind == "gap"]
    assert len(said) == gaps
    assert all(text.startswith("1 gap, the longest 0.238 s") for text in said)  # 100 periods and the wait for 20


def test_the_rate_is_that_of_many_samples(tmp_path):
    """By twenty at a time, and by seconds since 1970 in floating point, whose steps are whole 238 ns."""
    rig.write(tmp_path / "run.mcap", wrench=bursts(), imu=imu_channel(400))
    rates = {channel.topic: channel.rate_hz for channel in rig.inspect(tmp_path / "run.mcap").channels}
    assert rates["/wrench"] == pytest.approx(500, rel=1e-9)
    seconds = 1_780_000_000 + np.arange(10_000) / 250
    stamp = ((seconds - seconds[0]) * 1e9).astype(np.int64)
    assert 1e9 / device_clock.steady_period(stamp) == pytest.approx(250, rel=1e-9)
    assert 1e9 / np.median(np.diff(stamp)) > 250.002  # what the median of single steps says


def test_messages_that_overtook_each_other_stand_in_the_order_of_their_stamps(generator):
    """500 Hz through a network of 0.4 ms, exponential: the log's order is not the stamps', which are a clock's."""
    sent = wrench_channel(3000, rate=500.0)
    log_time = sent.stamp + generator.exponential(400_000, 3000).astype(np.int64)
    order = np.argsort(log_time)
    arrays = ("stamp", "force", "moment", "sequence")
    arrived = replace(sent, log_time=log_time[order], **{name: getattr(sent, name)[order] for name in arrays})
    assert (np.diff(arrived.stamp) < 0).any()
    again = arrived.in_order()
    for name in arrays:
        np.testing.assert_array_equal(getattr(again, name), getattr(sent, name))
    np.testing.assert_array_equal(again.log_time, log_time)


@pytest.mark.parametrize("back", [2_000_000, 37_100_000, 10_000_000_000])
def test_a_clock_that_was_set_back_orders_nothing(back):
    channel = wrench_channel(3000, rate=500.0)
    channel = replace(channel, stamp=channel.stamp - back * (np.arange(3000) >= 1500))
    assert channel.in_order() is channel


def test_a_number_of_all_messages_is_no_counter_of_a_device(tmp_path):
    """1 kHz beside 100 Hz, numbered together as some writers do: nothing is missing, and a loss by two counters is."""
    wrench, imu = wrench_channel(1000), imu_channel(100, rate=100.0)
    order = np.argsort(np.concatenate([wrench.log_time, imu.log_time]))
    number = np.empty(1100, np.uint32)
    number[order] = np.arange(1100)
    together = {"wrench": replace(wrench, sequence=number[:1000]), "imu": replace(imu, sequence=number[1000:])}
    rig.write(tmp_path / "together.mcap", **together)
    assert not {finding.kind for finding in rig.inspect(tmp_path / "together.mcap").findings}
    lost = replace(wrench, sequence=wrench.sequence + (np.arange(1000) > 500).astype(np.uint32))
    rig.write(tmp_path / "apart.mcap", wrench=lost, imu=imu)
    assert {finding.kind for finding in rig.inspect(tmp_path / "apart.mcap").findings} == {"gap"}


@pytest.mark.parametrize(("counted", "gaps"), [(True, 0), (False, 1)])
def test_a_wait_in_which_the_counter_misses_nothing_is_no_gap(counted, gaps):
    late = 20_000_000 * (np.arange(2000) >= 1000)  # by 20 ms from the middle on, as after a short stall of the host
    channel = wrench_channel(2000)
    channel = replace(channel, stamp=channel.stamp + late, sequence=channel.sequence if counted else None)
    assert sum(finding.kind == "gap" for finding in channel_findings(channel, 0.0)) == gaps


NUMBERLESS = [
    ("force", slice(None), np.nan, "force is no finite number throughout: check sensor and driver"),
    ("moment", 1, np.inf, "moment y is no finite number throughout: check sensor and driver"),
    ("angular_velocity", 0, -np.inf, "angular velocity x is no finite number throughout: check sensor and driver"),
    ("linear_acceleration", slice(None), np.nan, "acceleration is no finite number throughout: it is not used"),
    ("linear_acceleration", 2, np.nan, "acceleration z is no finite number throughout: it is not used"),
]


@pytest.mark.parametrize(("name", "axes", "value", "text"), NUMBERLESS)
def test_a_signal_that_is_never_a_number_is_a_finding(tmp_path, name, axes, value, text):
    """IMUs without an accelerometer publish it so."""
    channels = {"wrench": wrench_channel(400), "imu": imu_channel(400)}
    kind = "wrench" if hasattr(channels["wrench"], name) else "imu"
    values = getattr(channels[kind], name).copy()
    values[:, axes] = value
    channels[kind] = replace(channels[kind], **{name: values})
    rig.write(tmp_path / "run.mcap", **channels)
    findings = [finding for finding in rig.inspect(tmp_path / "run.mcap").findings if finding.kind == "not finite"]
    assert [(finding.topic, finding.text) for finding in findings] == [(f"/{kind}", text)]


def test_a_few_numbers_among_none_are_not_judged():
    """Three samples tell neither a held nor a saturated signal."""
    channel = imu_channel(400)
    values = np.where(np.arange(400)[:, None] < 3, channel.linear_acceleration, np.nan)
    found = channel_findings(replace(channel, linear_acceleration=values), 0.0)
    assert [finding.text for finding in found] == [
        "acceleration is no finite number in 397 of 400 samples: it is not used"
    ]

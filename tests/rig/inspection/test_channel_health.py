"""``rig.inspect`` looks at the health of channels and leaves what their values mean to who knows."""

from dataclasses import replace

import numpy as np
import pytest

import rig
from rig.inspection.channel_health import Finding, channel_findings
from tests.rig_samples import imu_channel, wrench_channel


def test_health_alone_says_nothing_of_units(tmp_path):
    imu = imu_channel(400)
    object.__setattr__(imu, "linear_acceleration", imu.linear_acceleration / 9.80665)
    rig.write(tmp_path / "run.mcap", wrench=wrench_channel(400), imu=imu)
    assert not {"unit", "axes", "sign"} & {finding.kind for finding in rig.inspect(tmp_path / "run.mcap").findings}


def test_a_judge_adds_what_it_knows(tmp_path):
    rig.write(tmp_path / "run.mcap", wrench=wrench_channel(400), imu=imu_channel(400))
    verdict = Finding("mass", "/wrench", "too light")

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

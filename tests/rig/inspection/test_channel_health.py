"""``rig.inspect`` looks at the health of channels and leaves what their values mean to who knows."""

import numpy as np

import rig
from rig.inspection.channel_health import Finding
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

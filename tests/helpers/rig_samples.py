"""Runs with known values, for the tests of the rig."""

from pathlib import Path

import numpy as np

from rig.channels import ImuChannel, WrenchChannel

SHARED = Path(__file__).parents[3] / "shared" / "data"


def wrench_channel(n=200, *, seed=1, topic="/wrench", frame="body", rate=1000.0):
    draw = np.random.default_rng(seed)
    log_time = 5_000_000_000 + (np.arange(n) * 1e9 / rate).astype(np.int64)
    return WrenchChannel(
        topic=topic,
        frame_id=frame,
        log_time=log_time,
        stamp=log_time - 300_000,
        force=draw.normal(size=(n, 3)),
        moment=draw.normal(size=(n, 3)),
        sequence=np.arange(7, n + 7).astype(np.uint32),
    )


def imu_channel(n=200, *, seed=2, topic="/imu", frame="imu_link", rate=1000.0):
    draw = np.random.default_rng(seed)
    log_time = 5_000_100_000 + (np.arange(n) * 1e9 / rate).astype(np.int64)
    return ImuChannel(
        topic=topic,
        frame_id=frame,
        log_time=log_time,
        stamp=log_time - 200_000,
        angular_velocity=draw.normal(size=(n, 3)),
        linear_acceleration=draw.normal(size=(n, 3)),
        sequence=np.arange(n).astype(np.uint32),
    )


WRENCH_COLUMNS = ("log_time", "stamp", "sequence", "force", "moment")
IMU_COLUMNS = ("log_time", "stamp", "sequence", "angular_velocity", "linear_acceleration")


def assert_same(one, other, columns):
    assert (one.topic, one.frame_id) == (other.topic, other.frame_id)
    for name in columns:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def only(parser, data):
    """The one sample of a whole frame."""
    (sample,) = parser.feed(data)
    counts = parser.counts
    assert (counts.framed, counts.skipped, counts.failures, counts.bytes) == (len(data), 0, 0, len(data))
    return sample

"""A file that grows is read behind its writer: each message once, whatever the writer has written of the next."""

import numpy as np
import pytest

from rig import runs
from rig.bags import topics
from rig.bags.growing_file import GrowingFile
from rig.exceptions import RigError
from rig.mcap.message_definitions import IMU, WRENCH
from tests.helpers.rig_samples import imu_channel, wrench_channel

ALL = {WRENCH: None, IMU: None}
COLUMNS = {WRENCH: ("log_time", "stamp", "force", "moment"), IMU: ("log_time", "angular_velocity")}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    runs.write(path, wrench=wrench_channel(5000), imu=imu_channel(4000), metadata={"rig.run": {"note": "a"}})
    return path


def taken(contents, into):
    for name, messages in contents.topics.items():
        arrays = messages.arrays()
        for column in COLUMNS[messages.type_name]:
            into.setdefault((name, column), []).append(arrays[column])


def test_every_message_comes_once_however_the_file_grows(whole, tmp_path, generator):
    data, into = whole.read_bytes(), {}
    growing = GrowingFile(tmp_path / "run.mcap", ALL)
    taken(growing.take(), into)  # there is no file yet
    cuts = np.sort(generator.integers(0, len(data), 40))
    with open(growing.path, "wb", buffering=0) as stream:
        for start, stop in zip([0, *cuts], [*cuts, len(data)], strict=True):
            stream.write(data[start:stop])
            taken(growing.take(), into)
    assert growing.ended
    assert growing.definitions.metadata == {"rig.run": {"note": "a"}}
    contents = topics.load(whole, only=ALL)
    for name, messages in contents.topics.items():
        arrays = messages.arrays()
        for column in COLUMNS[messages.type_name]:
            assert len(into[name, column]) > 1
            np.testing.assert_array_equal(np.concatenate(into[name, column]), arrays[column])


def test_only_the_named_topic_is_taken(whole):
    assert set(GrowingFile(whole, {WRENCH: "/wrench"}).take().topics) == {"/wrench"}


def test_a_damaged_chunk_is_no_measurement(whole, tmp_path):
    data = bytearray(whole.read_bytes())
    data[len(data) // 3] ^= 1
    path = tmp_path / "run.mcap"
    path.write_bytes(data)
    with pytest.raises(RigError, match="cut or damaged MCAP"):
        GrowingFile(path, ALL).take()


def test_another_file_is_none(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"no recording at all")
    with pytest.raises(RigError, match="does not begin as an MCAP"):
        GrowingFile(path, ALL).take()

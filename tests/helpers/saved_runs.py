"""A run in a file of small chunks, and its rows as they are read back."""

from rig import runs
from rig.mcap.writer import new_writer, register
from tests.helpers.rig_samples import imu_channel, wrench_channel

METADATA = {"rig.run": {"note": "a run"}}


def written(path, compression="zstd", n=200):
    """A run of 2 n messages in small chunks, one known row a message."""
    wrench, imu = wrench_channel(n), imu_channel(n)
    with open(path, "wb") as stream:
        writer = new_writer(stream, compression=compression, chunk_size=1600)
        for name, facts in METADATA.items():
            writer.add_metadata(name, runs.seal(name, facts))
        streams = []
        for channel in (wrench, imu):
            number = register(writer, runs.message_type(channel), channel.topic)
            streams.append(runs._messages(channel, number))
        for pair in zip(*streams, strict=True):
            for time, number, data, stamp, sequence in pair:
                writer.add_message(number, time, data, stamp, sequence)
        writer.finish()
    return rows(path)


def rows(path):
    """Every message of a file as {(topic, log_time): its numbers}."""
    found = {}
    contents = runs.load(path)
    for topic, pieces in contents.topics.items():
        columns = pieces.arrays()
        values = [v for name, v in columns.items() if v.ndim == 2]
        keep = zip(columns["log_time"], columns["stamp"], columns["sequence"], *values, strict=True)
        for time, stamp, sequence, *numbers in keep:
            found[topic, int(time)] = (int(stamp), int(sequence), *(row.tobytes() for row in numbers))
    return found

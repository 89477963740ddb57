"""Commands on what is no bag: a FIFO, a file without messages."""

import os

import pytest
from mcap.writer import Writer as McapWriter

from rig import runs
from rig.mcap.recover import recover
from uq.cli.main import main


@pytest.mark.parametrize("command", [("inspect",), ("recover", "-o", "new.mcap")])
def test_a_fifo_is_refused(tmp_path, command, capsys):
    """Without a writer, opening it would wait for ever."""
    os.mkfifo(tmp_path / "run.mcap")
    assert main([command[0], str(tmp_path / "run.mcap"), *command[1:]]) == 2
    assert "but a FIFO" in capsys.readouterr().err
    (tmp_path / "bag").mkdir()
    os.mkfifo(tmp_path / "bag" / "run.mcap")
    if command[0] == "inspect":
        assert main(["inspect", str(tmp_path / "bag")]) == 2
        assert "but a FIFO" in capsys.readouterr().err


def test_an_intact_file_without_messages_is_said_to_be_intact(tmp_path, capsys):
    with open(tmp_path / "empty.mcap", "wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        writer.finish()
    result = recover(tmp_path / "empty.mcap", tmp_path / "new.mcap")
    assert result.intact
    assert (result.messages, result.lost_bytes) == (0, 0)
    assert "the file is intact and holds no messages" in str(result)
    assert not runs.load(tmp_path / "new.mcap").topics
    assert main(["recover", str(tmp_path / "empty.mcap"), "-o", str(tmp_path / "again.mcap")]) == 0

"""Ports and the emulator's terminals: nothing that a device says is lost or said twice."""

import os
import tty

from rig.emulation.endpoints import Pty
from rig.record.discover import discover
from rig.record.port import SerialPort


def test_what_arrives_while_a_port_is_being_opened_is_heard():
    """A sensor that boots when its port is opened speaks at once; written before, it is surely there in time."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.write(master, b"name: SensONE")
    port = SerialPort(os.ttyname(slave), 460800)
    assert port.read() == b"name: SensONE"
    port.close()
    os.close(slave)
    os.close(master)


def test_what_a_reader_left_unread_is_not_heard_by_the_next(tmp_path):
    """As with a serial line, which forgets when it is closed."""
    line = Pty(tmp_path / "port")
    first = SerialPort(str(line.link), 115200)
    line.write(b"left over")
    first.close()
    assert not line.opened
    line.forget()
    second = SerialPort(str(line.link), 115200)
    line.write(b"new")
    assert second.read() == b"new"
    second.close()
    line.unplug()


def test_a_port_that_cannot_be_opened_is_listed_with_the_reason(tmp_path):
    (port,) = discover([str(tmp_path / "none")])
    assert (port.name, port.kind) == (str(tmp_path / "none"), "")
    assert port.complaint.startswith(f"no port {tmp_path}")

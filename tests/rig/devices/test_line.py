"""Devices that print lines: comments are no failures, units and counts become SI, a unit of another quantity is refused."""

import pytest

from rig.devices import create_device
from rig.exceptions import RigError
from rig.record.reader import Event
from tests.helpers.rig_lab import device_source

RIG = '[[device]]\nname = "d"\nkind = "line"\nport = "/dev/none"\noptions = { columns = ["time ms", "level m"] }\n'


def wrench(unit, **more):
    names = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
    return create_device("line", columns=[f"{name} {unit[name[0]]}" for name in names], **more)


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
def test_comments_of_an_arduino_are_no_failures(tmp_path, end):
    source = device_source(tmp_path, RIG)
    printed = [
        b"rest of a line",
        b"Load cell ready",
        b"",
        b"time level",
        b"1 2",
        b"# tare done",
        b"",
        b"  #3 4",
        b"2 3",
    ]
    list(source.take(Event(10**9, end.join(printed) + end)))
    assert (source.counts.samples, source.counts.failures, source.counts.resynchronisations) == (2, 0, 0)
    assert source.complete
    list(source.take(Event(2 * 10**9, b"3 4" + end + b"4 oops" + end + b"5 6" + end)))
    assert (source.counts.failures, source.complete) == (1, False)
    assert source.incomplete == "1 bad (lines that are not as `columns` says)"


@pytest.mark.parametrize(
    ("force", "moment", "newtons", "newton_metres"),
    [
        ("gf", "gf*cm", 9.80665e-3, 9.80665e-5),
        ("kgf", "kgf*m", 9.80665, 9.80665),
        ("lbf", "lbf*in", 4.4482216152605, 0.1129848290276167),
        ("lbf", "lbf*ft", 4.4482216152605, 1.3558179483314004),
        ("0.0125 N", "-2e-3 N*m", 0.0125, -0.002),
        ("2.5 gf", "1", 2.5 * 9.80665e-3, 1.0),
    ],
)
def test_forces_and_moments_in_units_of_weight_and_in_counts(force, moment, newtons, newton_metres):
    device = wrench({"f": force, "m": moment})
    numbers = device.numbers(b"1 2 3 4 5 6\n")
    expected = [k * (newtons if k < 4 else newton_metres) for k in range(1, 7)]
    assert device.sample(numbers).values == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ({"f": "g", "m": "N*m"}, "N, kN, gf, kgf, lbf"),  # grams, once taken for an acceleration
        ({"f": "N", "m": "N"}, r"N\*m"),
        ({"f": "0 N", "m": "N*m"}, "factor"),
        ({"f": "nan N", "m": "N*m"}, "factor"),
        ({"f": "1 2 N", "m": "N*m"}, "unknown unit"),
    ],
)
def test_a_unit_of_another_quantity_is_refused(unit, words):
    with pytest.raises(RigError, match=words):
        wrench(unit)

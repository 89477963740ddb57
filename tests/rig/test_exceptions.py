"""What messages repeat of a user's text: one line, not too long."""

import errno

import pytest

from rig.exceptions import ECHO, cure, listed, on_one_line, quoted

VALUES = ["a\nb", "x" * 10**6, "\x00\x1b[31m\u2028", 10**4000, 10**5000, [["y" * 90] * 9], "é" * 60]


@pytest.mark.parametrize("value", VALUES, ids=range(len(VALUES)))
def test_a_value_is_one_short_line(value):
    assert quoted(value).isprintable()
    assert 0 < len(quoted(value)) <= ECHO


def test_a_short_value_is_repeated_as_it_is():
    assert (quoted("19.7 kg"), quoted(3), quoted("a\nb")) == ("'19.7 kg'", "3", r"'a\nb'")
    long = "begin" + "x" * 1000 + "end"
    assert quoted(long).startswith("'beginx")
    assert quoted(long).endswith("xend'")


def test_of_many_names_the_first_are_listed():
    assert listed(["T1", "T2"]) == "T1, T2"
    assert (
        listed(f"name{k}" for k in range(100)) == "name0, name1, name2, name3, name4, name5, name6, name7 and 92 more"
    )
    assert listed(["x" * 500, "b\n"]).isprintable()
    assert len(listed(["x" * 500, "b\n"])) <= ECHO + 20


def test_control_characters_are_written_out():
    assert on_one_line("ab\n\x07ü") == r"ab\n\u0007ü"


@pytest.mark.parametrize(("number", "words"), [(errno.ENOSPC, "free some space"), (errno.EFBIG, "ulimit -f")])
def test_a_failure_of_the_system_has_its_own_cure(number, words):
    assert words in cure(OSError(number, "as the system says"))

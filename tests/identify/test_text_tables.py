"""Tables on narrow terminals."""

import pytest

from identify.display.text_tables import Table, in_lines, text_table

HEAD = ("run", "unit", "I11", "I12", "I22")
ROWS = (("T1", "g·m²", "−1.17 ± 0.91", "0.41 ± 0.57", "7.7"), ("T2", "g·m²", "1.00 ± 0.50", "–", "12.25"))


@pytest.mark.parametrize("width", range(24, 60))
def test_no_line_is_wider_and_no_figure_is_lost(width):
    text = text_table(HEAD, ROWS, width)
    assert max(map(len, text.splitlines())) <= width
    for cell in (*HEAD[2:], *ROWS[0][2:], *ROWS[1][2:]):
        assert text.count(cell) == sum(row.count(cell) for row in (HEAD, *ROWS))


def test_a_table_that_fits_is_not_divided():
    assert text_table(HEAD, ROWS, 45) == text_table(HEAD, ROWS, 1000)
    assert len(text_table(HEAD, ROWS, 45).splitlines()) == 4


def test_each_part_of_a_wide_table_has_the_names_of_its_rows():
    first, second = text_table(HEAD, ROWS, 38).split("\n\n")
    assert first.splitlines()[0].split() == ["run", "unit", "I11", "I12"]
    assert second.splitlines()[2:] == ["T1   g·m²    7.7", "T2   g·m²  12.25"]


def test_where_no_figure_fits_beside_its_labels_each_has_a_line():
    assert text_table(HEAD, ROWS[:1], 20).splitlines() == [
        "run T1, unit g·m²",
        "  I11 −1.17 ± 0.91",
        "  I12 0.41 ± 0.57",
        "  I22 7.7",
    ]


def test_text_is_broken_between_words():
    lines = text_table(("cause", "what it does"), [("turned", "the load cell is turned against the body")], 24)
    assert lines.splitlines() == [
        "cause turned",
        "  what it does the load",
        "    cell is turned",
        "    against the body",
    ]


def test_a_long_line_is_broken_between_words_and_short_ones_stay():
    text = "  table  1\n\n" + "  suspicious /imu: " + 'set force_unit = "lbf" in [recording], ' * 9
    first, second, *broken = in_lines(text).split("\n")
    assert [first, second] == ["  table  1", ""]
    assert len(broken) > 1
    assert max(map(len, broken)) < 200
    assert " ".join(map(str.strip, broken)) == text.split("\n")[2].strip()


def test_columns_of_the_environment_count(monkeypatch):
    monkeypatch.setenv("COLUMNS", "38")
    assert "\n\n" in repr(Table("", HEAD, ROWS))
    monkeypatch.delenv("COLUMNS")
    assert "\n\n" not in repr(Table("", HEAD, ROWS))

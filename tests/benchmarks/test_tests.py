"""What the tests cost, from the lines that a run writes."""

from benchmarks.tests import by_file, report, usages

LINES = """0.50\t700\t0\tgw0\ttests/a.py::test_a
3.25\t900\t0\tgw0\ttests/b.py::test_b[x-1.0]
1.00\t650\t0\tgw1\ttests/c.py::test_c
2.00\t900\t0\tgw0\ttests/b.py::test_c
"""


def test_seconds_and_memory_of_tests_and_files():
    found, largest = usages(LINES)
    assert [usage.megabytes for usage in found] == [700, 200, 650, 0]
    assert largest == {"gw0": 900, "gw1": 650}
    assert {usage.test: usage.seconds for usage in by_file(found)} == {
        "tests/a.py": 0.5, "tests/b.py": 5.25, "tests/c.py": 1.0,
    }  # fmt: skip
    text = report(LINES, 1)
    assert "4 tests, 7 s of user time; largest memory: gw0 900 MB, gw1 650 MB" in text
    assert "tests/b.py::test_b[x-1.0]" in text
    assert "test_a" not in text

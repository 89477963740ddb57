"""A caller's mistake is answered in one line with the call, or the names, as they should be."""

import inspect
import re

import pytest

from identify.exceptions import UnknownNameError, explains_names


@explains_names
def weigh(body, *, trials=3, seed=0):
    """Return what it is given."""
    return body, trials, seed


def test_a_call_that_is_right_goes_through():
    assert weigh("a", seed=2) == weigh(body="a", seed=2) == ("a", 3, 2)
    assert list(inspect.signature(weigh).parameters) == ["body", "trials", "seed"]
    with pytest.raises(TypeError, match="unexpected keyword argument 'sede'"):
        weigh("a", sede=1)


@pytest.mark.parametrize(
    ("arguments", "call"),
    [((None, 200), "weigh(body, trials=200)"), ((None, 1, []), "weigh(body, trials=1, seed=…)")],
)
def test_what_must_be_named_is_shown_named(arguments, call):
    with pytest.raises(
        TypeError, match=f"^{re.escape(f'weigh() takes its other arguments by their names: write {call}')}$"
    ):
        weigh(*arguments)


def test_an_unknown_name_is_answered_with_those_that_there_are():
    error = UnknownNameError("c", {"a": 1, "b": 2})
    assert isinstance(error, KeyError)
    assert str(error) == "no 'c': choose one of 'a', 'b'"

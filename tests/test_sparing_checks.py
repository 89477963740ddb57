"""Annotated shapes are checked at the first calls of a function in each test."""

import jax.numpy as jnp
import pytest
from jaxtyping import TypeCheckError

from identify.rigid_body.inertia import pack
from tests.helpers.sparing_checks import CALLS, jaxtyped


def of_wrong_shape():
    """How many of some calls are refused; of a larger matrix the first three rows would be taken."""
    refused = 0
    for _ in range(CALLS + 3):
        try:
            pack(jnp.zeros((4, 4)))
        except TypeCheckError:
            refused += 1
    return refused


@pytest.mark.parametrize("test", ["first", "next"])
def test_a_wrong_shape_is_refused_at_the_first_calls_of_each_test(test):
    assert of_wrong_shape() == CALLS


def test_a_function_without_annotations_is_left_alone():
    def plain(x):
        return x

    assert jaxtyped(plain, typechecker=None) is plain

"""The tests' own check of annotated shapes and types: once for each kind of call, but of every kind."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from tests.helpers.checked_calls import beartyped


@beartyped
def repeated(a: Float[np.ndarray, "n"], b: Float[np.ndarray, "n"], times: int = 1) -> Float[np.ndarray, "n"]:
    return (a + b) * times if times else np.zeros(len(a) + 1)


def refused(function, *args, **options):
    with pytest.raises(Exception, match=r"Type-check error"):
        function(*args, **options)


def test_every_kind_of_call_is_checked():
    three, four = np.ones(3), np.ones(4)
    for _ in range(2):
        np.testing.assert_array_equal(repeated(three, three), 2 * three)
        refused(repeated, three, four)
        refused(repeated, three, three.astype(np.float32).astype(int))
        refused(repeated, three, three, times="2")


def test_a_result_of_another_kind_is_checked_though_the_call_is_known():
    three = np.ones(3)
    repeated(three, three, times=2)
    for _ in range(2):
        refused(repeated, three, three, times=0)
    np.testing.assert_array_equal(repeated(three, three, times=2), 4 * three)


def test_fields_methods_and_traced_arrays_are_checked():
    @beartyped
    @dataclasses.dataclass
    class Pair:
        a: Float[Array, "3"]

        @beartyped
        def scaled(self, by: float) -> Float[Array, "3"]:
            return self.a * by

    for _ in range(2):
        assert Pair(jnp.ones(3)).scaled(2.0).shape == (3,)
        refused(Pair, jnp.ones(4))
        refused(Pair(jnp.ones(3)).scaled, "2")
        jax.jit(lambda a: Pair(a).scaled(1.0))(jnp.ones(3))
        with pytest.raises(Exception, match=r"Type-check error"):
            jax.jit(lambda a: Pair(a).scaled(1.0))(jnp.ones(2))


def test_a_container_of_ours_is_not_looked_through():
    class Ours(dict):
        @beartyped
        def __iter__(self):
            return super().__iter__()

        @beartyped
        def items(self):
            return [(key, self[key]) for key in self]

    assert Ours(a=1).items() == [("a", 1)]

"""A compiled program: one for each kind of arguments, and a plain function inside a trace."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.compiled_program import CompiledProgram

TRACED = []
MATRIX = np.array([[4.0, 2.0], [2.0, 3.0]])


@pytest.fixture
def program():
    TRACED.clear()

    def root_of(matrix, name, factor=1.0):
        TRACED.append(name)
        return {"root": factor * jnp.linalg.cholesky(matrix), "name": (matrix[0, 0],)}

    return CompiledProgram(root_of)


def test_other_numbers_in_arrays_run_the_same_program(program):
    first, second = (program(size * MATRIX, "a", factor=2.0)["root"] for size in (1, 9))
    np.testing.assert_allclose(first, 2 * np.linalg.cholesky(MATRIX), rtol=1e-15)
    np.testing.assert_allclose(second, 3 * first, rtol=1e-15)
    assert TRACED == ["a"]


@pytest.mark.parametrize(
    "arguments",
    [(MATRIX, "b"), (MATRIX, "a", 1), (MATRIX, "a", -1.0), (MATRIX.astype(np.float32), "a"), (np.eye(3), "a")],
)
def test_what_changes_the_code_is_another_program(program, arguments):
    program(MATRIX, "a")
    root = program(*arguments)["root"]
    assert len(TRACED) == 2
    np.testing.assert_allclose(root, (arguments[2:] or (1.0,))[0] * np.linalg.cholesky(arguments[0]), rtol=1e-6)


@pytest.mark.parametrize(("first", "second"), [(0.0, -0.0), (1, True), (1, 1.0)])
def test_static_values_that_python_holds_for_equal_are_told_apart(first, second):
    length = CompiledProgram(lambda x, value: x + len(repr(value)))
    assert length(np.ones(()), first) - len(repr(first)) == 1 == length(np.ones(()), second) - len(repr(second))
    assert first == second


def test_inside_a_trace_it_is_a_function(program):
    slope = jax.jacfwd(lambda scale: program(scale * MATRIX, "a")["root"])(4.0)
    np.testing.assert_allclose(slope, np.linalg.cholesky(MATRIX) / 4, rtol=1e-12)

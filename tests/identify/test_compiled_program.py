"""Compiled programs that are kept: loaded, they trace nothing and give the same; what a store cannot know is not kept."""

import os
import subprocess
import sys
from pathlib import Path
from types import MappingProxyType

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify import compiled_program
from identify.compiled_program import CompiledProgram, UnknownCodeError, described
from identify.motion.trajectory import sample
from uq.sources.source import KINDS, ErrorKind, Source

ROOT = Path(__file__).parents[2]
TRACED = []
MATRIX = np.array([[4.0, 2.0], [2.0, 3.0]])


def root_of(matrix, name, factor=1.0):
    TRACED.append(name)
    return {"root": factor * jnp.linalg.cholesky(matrix), "name": (matrix[0, 0],)}


class Kept(dict):
    """A store in memory."""

    load = dict.get
    save = dict.__setitem__


@pytest.fixture
def store(monkeypatch):
    monkeypatch.setattr(compiled_program, "PACKAGES", frozenset({"identify", "uq", "tests"}))
    monkeypatch.setattr(CompiledProgram, "store", kept := Kept())
    TRACED.clear()
    return kept


def test_a_loaded_program_traces_nothing_and_gives_the_same(store):
    first = CompiledProgram(root_of)(MATRIX, "a", factor=2.0)
    again = CompiledProgram(root_of)
    np.testing.assert_array_equal(again(MATRIX, "a", factor=2.0)["root"], first["root"])
    np.testing.assert_allclose(again(9 * MATRIX, "a", factor=2.0)["root"], 6 * np.linalg.cholesky(MATRIX), rtol=1e-15)
    assert (TRACED, len(store)) == (["a"], 1)


@pytest.mark.parametrize(
    "arguments",
    [
        (MATRIX, "b"),
        (MATRIX, "a", 1),
        (MATRIX.astype(np.float32), "a"),
        (np.eye(3), "a"),
        (jnp.asarray(MATRIX), "a", 2.0),
    ],
)
def test_what_changes_the_code_is_another_program(store, arguments):
    program = CompiledProgram(root_of)
    program(MATRIX, "a")
    program(*arguments)
    assert len(store) == 2
    np.testing.assert_allclose(
        program(*arguments)["root"], (arguments[2:] or (1.0,))[0] * np.linalg.cholesky(arguments[0]), rtol=1e-6
    )


def test_inside_a_trace_it_is_a_function(store):
    program = CompiledProgram(root_of)
    slope = jax.jacfwd(lambda scale: program(scale * MATRIX, "a")["root"])(4.0)
    np.testing.assert_allclose(slope, np.linalg.cholesky(MATRIX) / 4, rtol=1e-12)
    assert not store


def test_what_is_not_whole_is_compiled_again(store):
    CompiledProgram(root_of)(MATRIX, "a")
    (name,) = store
    store[name] = None
    np.testing.assert_allclose(CompiledProgram(root_of)(MATRIX, "a")["root"], np.linalg.cholesky(MATRIX), rtol=1e-15)
    assert store[name] is not None


@pytest.mark.parametrize(
    ("first", "second"), [(0.0, -0.0), (1, True), (1, 1.0), ((1,), [1]), ("1", 1), ({"a": 1}, {"a": 2})]
)
def test_values_that_compile_differently_are_described_differently(first, second):
    assert repr(described(first)) != repr(described(second))


class Theirs(ErrorKind):
    targets = MappingProxyType({"F": "N"})


def test_code_of_others_is_unknown(monkeypatch):
    """A user's own kind of error, a function of theirs, one that holds values of its own."""
    monkeypatch.setitem(KINDS, ("F", "theirs"), Theirs())
    ours = Source("a", "F", "bias", "load_cell", np.ones(3))
    assert described(ours) == described(Source("a", "F", "bias", "load_cell", 2 * np.ones(3)))
    theirs = Source("a", "F", "theirs", "load_cell", np.ones(3))
    for unknown in (theirs, [theirs], lambda x: x, np.sin, test_code_of_others_is_unknown, object()):
        with pytest.raises(UnknownCodeError):
            described(unknown)
    assert described(sample) == ("identify.motion.trajectory", "sample")


SCRIPT = """
import sys
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
from pathlib import Path
from identify import compiled_program
from identify.compiled_program import CompiledProgram
from uq.files.compilation_cache import ProgramFolder
from tests.identify import test_compiled_program as here
compiled_program.PACKAGES = frozenset({"tests"})
CompiledProgram.store = ProgramFolder(Path(sys.argv[1]))
print(CompiledProgram(here.root_of)(here.MATRIX, "a")["root"].tolist(), len(here.TRACED))
"""


def test_a_new_process_finds_lapack(tmp_path):
    """A program that calls LAPACK ended the process where nothing had been lowered before."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "INERTIA_CACHE": "off"}
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    said = [
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout for _ in range(2)
    ]
    root = np.linalg.cholesky(MATRIX)
    assert [text.split("] ")[1].strip() for text in said] == ["1", "0"]
    for text in said:
        np.testing.assert_allclose(np.array(eval(text[: text.rindex("]") + 1])), root, rtol=1e-15)

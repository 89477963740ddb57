"""Kinds of error: each says what it does; nothing outside their folder asks which kind or target a source is of."""

import ast
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import uq
from uq.sources.constant_errors import Errors, effect, no_errors, perturbed
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import KINDS, SIGNALS, ErrorKind, SignalRange, Source, kind_of

ROOT = Path(uq.__file__).parent
CONSTANT = [pair for pair, kind in KINDS.items() if kind.constant]


def of_kind(target, name, sigma=1.0):
    kind = kind_of(target, name)
    settings = {"centre": np.array([1.0, 2.0, 3.0]), "radii_of_gyration": np.array([1.0, 2.0, 3.0])}
    return Source("s", target, name, "g", np.full(kind.shape, sigma), settings=settings)


@pytest.mark.parametrize(("target", "name"), KINDS)
def test_a_kind_is_complete(target, name):
    kind = kind_of(target, name)
    assert not (kind.constant and kind.noise)
    assert kind.noise or not kind.white
    assert kind.constant == (bool(kind.perturbs) or isinstance(kind, ErrorByAct))
    assert set(kind.perturbs.values()) <= set(Errors._fields)
    assert target in SIGNALS or not (kind.noise or kind.stage is not None)
    assert type(kind).__doc__


@pytest.mark.parametrize(("target", "name"), CONSTANT)
def test_a_constant_sets_one_field_linearly(target, name):
    """Twice the draw is twice the error, in the shape of the field that the kind names."""
    source = of_kind(target, name)
    draw = jnp.arange(1.0, 1 + np.size(source.sigma)).reshape(np.shape(source.sigma))
    if isinstance(source.error_kind, ErrorByAct):  # which acts on samples
        return
    once, twice = effect(source, draw), effect(source, 2 * draw)
    np.testing.assert_allclose(twice, 2 * once, rtol=1e-15)
    assert {source.perturbs} == perturbed([source])
    assert once.shape == getattr(no_errors(), source.perturbs).shape


@pytest.mark.parametrize("what", ["bias", "drift", "scale"])
def test_force_and_moment_have_their_own_channels(what):
    of = {target: effect(of_kind(target, what), jnp.array([1.0, 2.0, 3.0])) for target in "FM"}
    np.testing.assert_array_equal(of["F"], [1, 2, 3, 0, 0, 0])
    np.testing.assert_array_equal(of["M"], [0, 0, 0, 1, 2, 3])


def test_half_the_size_is_half_the_figures_that_are_sizes():
    step = Source("s", "F", "quantisation", "g", np.zeros(0), settings={"step": np.ones(3)})
    end = Source("s", "F", "saturation", "g", np.zeros(0), settings={"limit": np.ones(3)})
    np.testing.assert_array_equal(step.error_kind.resized(step, 0.5).settings["step"], 0.5)
    np.testing.assert_array_equal(end.error_kind.resized(end, 0.5).settings["limit"], 1)  # half a range errs more
    air = of_kind("displaced_air", "bias")
    np.testing.assert_array_equal(air.error_kind.resized(air, 0.5).settings["centre"], [1, 2, 3])


def test_a_kind_cannot_be_changed_and_an_unknown_one_is_refused():
    with pytest.raises(TypeError):
        kind_of("F", "bias").targets["x"] = "m"
    with pytest.raises(AttributeError):
        kind_of("F", "bias").constant = False
    with pytest.raises(ValueError, match="Argument `kind` must be a kind of error on F, but is 'wobble'"):
        Source("s", "F", "wobble", "g", np.ones(3)).constant  # noqa: B018


def test_a_kind_that_says_nothing_of_the_law_is_refused_by_it():
    class Rattle(ErrorKind):
        stage = 5

    class Hum(ErrorKind):
        noise = True

    unit = np.ones(3)
    signal = SignalRange(largest=unit, moves=unit, variance=unit, correlated=False, rests=0 * unit, noise=unit[None])
    source = of_kind("F", "bias")
    assert "every sample" in Rattle().beyond_the_law(source, signal)
    assert "not white" in Hum().beyond_the_law(source, signal)


def test_no_comparison_of_kind_or_target_stands_outside_the_kinds():
    """What a source is of is asked of its kind: no ``kind ==``, ``target in`` … elsewhere in the package."""
    switches = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in ROOT.rglob("*.py")
        if ROOT / "sources" / "kinds" not in path.parents
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Compare) and _is_a_switch(node)
    ]
    assert not switches


def _is_a_switch(compare):
    """Whether a kind or a target is compared; with words that no source's kind or target is, it is another's."""
    if not all(isinstance(operator, ast.Eq | ast.NotEq | ast.In | ast.NotIn) for operator in compare.ops):
        return False
    operands = [item for one in (compare.left, *compare.comparators) for item in getattr(one, "elts", [one])]
    asked = [one for one in operands if getattr(one, "attr", getattr(one, "id", None)) in ("kind", "target")]
    words = {one.value for one in operands if isinstance(one, ast.Constant)}
    return bool(asked) and (not words or bool(words & {word for pair in KINDS for word in pair}))

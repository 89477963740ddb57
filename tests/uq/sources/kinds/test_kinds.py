"""Kinds of error: each says what it does; nothing outside their folder asks which kind or target a source is of."""

import ast
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import uq
from uq.analysis.propagation.uncovered_sources import ANYWHERE, beyond_the_law
from uq.sources.constant_errors import Errors, effect, no_errors, perturbed
from uq.sources.draws import BLOCK, noise_at_rest, noise_of_block, noise_streams
from uq.sources.noise_filters import NoiseFilter, NoisePart
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import KINDS, SIGNALS, ErrorKind, Source, kind_of, signal_variance

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


def test_what_kinds_may_override_several_do():
    """Else it is that kind's own business: the class that all share says only what a new kind is asked."""
    kinds = {type(kind) for kind in KINDS.values() if type(kind).__module__.startswith("uq.")}
    classes = {cls for kind in kinds for cls in kind.__mro__ if issubclass(cls, ErrorKind) and cls is not ErrorKind}
    methods = [name for name, value in vars(ErrorKind).items() if callable(value) and not name.startswith("__")]
    overriding = {name: sum(name in vars(cls) for cls in classes) for name in methods}
    assert not {name for name, count in overriding.items() if count == 1} - {"written_as"}  # a class, as data


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
    np.testing.assert_array_equal(step.resized(0.5).settings["step"], 0.5)
    np.testing.assert_array_equal(end.resized(0.5).settings["limit"], 1)  # half a range errs more
    air = of_kind("displaced_air", "bias")
    np.testing.assert_array_equal(air.resized(0.5).settings["centre"], [1, 2, 3])


def test_a_kind_cannot_be_changed_and_an_unknown_one_is_refused():
    with pytest.raises(TypeError):
        kind_of("F", "bias").targets["x"] = "m"
    with pytest.raises(AttributeError):
        kind_of("F", "bias").constant = False
    with pytest.raises(ValueError, match="Argument `kind` must be a kind of error on F, but is 'wobble'"):
        Source("s", "F", "wobble", "g", np.ones(3)).constant  # noqa: B018


@pytest.fixture
def kinds(monkeypatch):
    """Users' kinds: of a stage that says nothing more, of a bias, and of noise by a filter of its own."""
    for pair in [("F", "rattle"), ("M", "thermal_zero"), ("M", "echo")]:
        monkeypatch.setitem(KINDS, pair, None)  # so that what is registered goes again

    class Rattle(ErrorKind):
        name, targets, stage = "rattle", {"F": "N"}, 5

    class ThermalZero(ErrorKind):
        name, targets, perturbs = "thermal_zero", {"M": "N*m/K"}, {"M": "cell_bias"}

        def value(self, source, draw):
            return 8.0 * draw

    class Echo(ErrorKind):
        name, targets = "echo", {"M": "N*m"}

        def noise_parts(self, source, rate):
            return [NoisePart(ECHO, source.settings["size"])]


def _echoed(white, before, dtype):
    """White noise, and half of each sample again a sample later."""
    fresh = white(dtype)
    return fresh + 0.5 * jnp.concatenate([before[:, None], fresh[:, :-1]], axis=1), fresh[:, -1]


ECHO = NoiseFilter("echo", lambda k: 1.0 * (k == 0) + 0.5 * (k == 1), _echoed, lambda dtype: jnp.zeros(3, dtype))


def test_a_stage_that_says_nothing_of_the_law_is_refused_by_it(kinds):
    rattle = Source("rattle", "F", "rattle", "g", np.ones(3))
    assert "every sample" in beyond_the_law([rattle], (), ANYWHERE)["rattle"]


def test_how_a_kind_is_drawn_follows_from_what_it_does(kinds):
    """Of a field of the errors once, of noise at each sample, of a stage not at all, though it may act as noise."""
    drawn = {name: (KINDS[target, name].constant, KINDS[target, name].noise) for target, name in
             [("M", "thermal_zero"), ("M", "echo"), ("F", "rattle"), ("F", "quantisation")]}  # fmt: skip
    assert drawn == {"thermal_zero": (True, False), "echo": (False, True), "rattle": (False, False),
                     "quantisation": (False, False)}  # fmt: skip


def test_noise_that_does_not_say_which_is_no_kind():
    """Else trials on sums would leave it out without a word."""
    with pytest.raises(TypeError, match="Hum is noise: define `noise_parts`"):
        type("Hum", (ErrorKind,), {"name": "hum", "targets": {"F": "N"}, "noise": True})
    assert ("F", "hum") not in KINDS


def test_every_bias_counts_in_a_signals_variance(kinds):
    """A zero that shifts by 8 K is a bias of eight times the figure: the end of a range is as much nearer."""
    bias, shift = (Source(name, "M", name, "g", np.array([1.0, 2.0, 3.0])) for name in ("bias", "thermal_zero"))
    np.testing.assert_allclose(signal_variance([bias, shift], SIGNALS.index("M")), 65 * np.array([1.0, 4.0, 9.0]))


def test_a_kind_of_noise_is_its_filters(kinds):
    """Stated once: a user's filter makes the samples, over the seams of blocks, and the law refuses its memory."""
    size = np.array([1.0, 2.0, 3.0])
    echo = Source("echo", "M", "echo", "g", np.zeros(0), settings={"size": size})
    assert "not white" in beyond_the_law([echo], (), ANYWHERE)["echo"]
    streams, dtype = noise_streams([echo], jax.random.key(1), jnp.asarray(0)), jnp.dtype(float)

    @jax.jit
    def drawn():
        block = lambda memory, k: noise_of_block([echo], (), streams, memory, k, jnp.asarray(100.0), dtype)[::-1]  # noqa: E731
        return jax.lax.scan(block, noise_at_rest([echo], dtype), jnp.arange(50))[1][0]

    noise = np.asarray(drawn()).swapaxes(0, 1).reshape(3, -1) / size[:, None]
    assert noise.shape == (3, 50 * BLOCK)
    # of 180,000 samples a covariance is known within 0.4 %: five of them
    np.testing.assert_allclose(
        [np.mean(noise[:, k:] * noise[:, : noise.shape[1] - k]) for k in (0, 1, 2)], [1.25, 0.5, 0], atol=0.02
    )
    seams = np.mean(noise[:, BLOCK::BLOCK] * noise[:, BLOCK - 1 : -1 : BLOCK])
    assert abs(seams - 0.5) < 5 * 1.4 / np.sqrt(3 * 49)


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

"""Error sources as data, and the kinds of error that they are of.

A :class:`Source` holds the figures of one cause of error. Everything that depends on its kind (its unit and shape, its
keys in ``[[source]]``, its effect on a sample or on the sums, its part in the law of propagation) stands in one
:class:`ErrorKind`, one file a kind in :mod:`uq.sources.kinds`. A kind is *constant* (one draw an experiment: a bias, a
scale factor, a delay …), *noise* (fresh at each sample), or nothing of it is drawn (saturation, quantisation).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.display.rounding import significant
from identify.pytree import Pytree, static_field
from uq.sources.distributions import Distribution, Normal
from uq.sources.draw_figures import DrawFigures, figures, part_of
from uq.sources.noise_filters import WHITE, NoisePart

SIGNAL_UNITS: Mapping[str, str] = MappingProxyType({"F": "N", "M": "N*m", "omega": "rad/s"})
"""Units of the measured signals; other targets are constants of the rig, of the body or of the whole load cell."""
SIGNALS = tuple(SIGNAL_UNITS)
SIGNAL_NUMBERS = {name: number for number, name in enumerate(SIGNALS)}
CHANNELS: Mapping[str, tuple[str, ...]] = MappingProxyType({"wrench": ("F", "M")})
"""Signals that a target consists of, where it is several."""


Draw = Float[Array | np.ndarray, "..."] | float
"""Values that a constant source draws, in SI."""


class Source(Pytree):
    """One error source. A constant's draw is ``mean + sigma * shape``; noise is ``sigma * shape`` at each sample."""

    name: str = static_field()
    """Name of the source, from which its random stream is keyed."""
    target: str = static_field()
    """The quantity that errs."""
    kind: str = static_field()
    """Kind of the error: ``precision`` is fresh at each sample, ``bias`` one draw an experiment; see
    docs/reference/sources.md."""
    group: str = static_field()
    """Group in which the source counts, such as ``load_cell``."""
    sigma: Float[Array | np.ndarray, "..."]
    """Scale of the draw on each axis, in SI: the standard deviation, but for Student's t."""
    reference: str = static_field(default="")
    """Publication or document from which the figure comes."""
    mean: Float[Array | np.ndarray, "..."] | float = 0.0
    """Expectation of a constant's draw, in SI: a known effect that is not corrected."""
    shape: Distribution = Normal(0.0, 1.0)
    """Distribution of the draw in units of ``sigma``, about its mean."""
    settings: Mapping[str, Float[Array | np.ndarray, "..."]] = field(default_factory=dict)
    """Figures that are not drawn, in SI: Allan parameters, a limit, a step, where the air's centre is."""

    def __repr__(self) -> str:
        stated = all(isinstance(leaf, (np.ndarray, np.generic, float, int)) for leaf in jax.tree.leaves(self))
        size = self.size if stated else "in JAX"
        return f"Source({self.name!r}: {self.kind} of {self.target}, {size})"

    @property
    def size(self) -> str:
        """Size of the source in words: standard deviation and settings in SI."""
        unit = self.error_kind.targets[self.target]
        texts = [f"{name.replace('_', ' ')} {on_axes(values)} (SI)" for name, values in self.settings.items()]
        sigma = np.asarray(self.standard_deviation) / part_of(unit)
        if sigma.ndim > 1:
            texts.insert(0, "6×6 matrix")
        elif sigma.size:
            texts.insert(0, f"{on_axes(sigma)} {unit}")
        return "; ".join(texts)

    @property
    def error_kind(self) -> "ErrorKind":
        """The kind of error that acts on the target."""
        return kind_of(self.target, self.kind)

    @property
    def standard_deviation(self) -> Any:
        """Standard deviation of the draw on each axis, in SI."""
        return self.sigma * self.shape.standard_deviation

    @property
    def variance(self) -> Float[np.ndarray, "3"]:
        """Variance of the draw on each of three axes, in SI."""
        return np.square(np.broadcast_to(np.asarray(self.standard_deviation, float), (3,)))

    @property
    def constant(self) -> bool:
        """Whether the source is drawn once an experiment."""
        return self.error_kind.constant

    @property
    def noise(self) -> bool:
        """Whether the source is drawn anew at each sample."""
        return self.error_kind.noise

    @property
    def white(self) -> bool:
        """Whether the source is noise whose samples are independent, of the source's distribution."""
        return self.error_kind.white

    @property
    def drawn(self) -> bool:
        """Whether anything of the source is drawn: true but for saturation and quantisation."""
        return self.constant or self.noise

    @property
    def perturbs(self) -> str | None:
        """The field of :class:`uq.sources.constant_errors.Errors` that its draw sets."""
        return self.error_kind.perturbs.get(self.target)

    def noise_parts(self, rate: float) -> list[NoisePart] | None:
        """Return the white noises behind filters that it is or acts as, at a rate [Hz]; None: none is stated."""
        parts = self.error_kind.noise_parts(self, rate)
        sized = (NoisePart(part.filter, np.asarray(part.sigma), part.stream) for part in parts or ())
        return None if parts is None else [part for part in sized if part.filter == WHITE or np.any(part.sigma)]

    def white_variance(self, rate: float) -> Float[np.ndarray, "3"] | None:
        """Return the variance of the white ones among its :meth:`noise_parts`; None: no noise is stated."""
        parts = self.noise_parts(rate)
        if parts is None or self.white:
            return None if parts is None else self.variance
        return sum((np.square(part.sigma) for part in parts if part.filter == WHITE), np.zeros(3))

    def resized(self, factor: float) -> "Source":
        """Return a source whose error is ``factor`` times as large; its expectation stays.

        The end of a range, of which nothing is drawn and which acts as no noise, is no error's size, and stays, too.
        """
        if not self.drawn and self.noise_parts(1.0) is None:
            return self
        sizes = {key: np.asarray(factor * self.settings[key]) for key in self.error_kind.sizes if key in self.settings}
        return replace(self, sigma=np.asarray(factor * self.sigma), settings={**self.settings, **sizes})

    @property
    def signal(self) -> int | None:
        """Index in :data:`SIGNALS` of the signal that errs; None: the rig, the body or the load cell does."""
        return SIGNAL_NUMBERS.get(self.target)

    @property
    def of_gyro(self) -> bool:
        """Whether the source is an error of the gyro."""
        return self.signal == SIGNAL_NUMBERS["omega"]


BIASES = ("cell_bias", "gyro_bias")
"""Fields of :class:`uq.sources.constant_errors.Errors` that add the same to every sample of a signal."""

MANY_SIGMA = 6.0
"""Standard deviations that must fit between a signal and the end of its range for the range not to matter."""


class SignalRange(NamedTuple):
    """Range of the signal that a source acts on, axis by axis [SI]: by it a kind says what sums and law can take."""

    largest: Float[np.ndarray, "3"]
    """Largest absolute value of the noise-free signal."""
    variance: Float[np.ndarray, "3"]
    """Variance of the signal's noise and biases together."""
    noise: Float[np.ndarray, "cases 3"]
    """Standard deviation of the independent, normal, white noise beside the source: in the case that is asked of, or in
    each that has a random error of the signal."""
    same_kind: tuple["Source", ...]
    """Other sources of this kind on the signal."""
    moves: Float[np.ndarray, "3"] = np.zeros(3)
    """Root mean square of the signal's change from one sample to the next, which counts in the law alone."""
    rests: Float[np.ndarray, "3"] = np.ones(3)
    """Part of the run in which the noise-free signal does not change, likewise."""

    @property
    def reach(self) -> Float[np.ndarray, "3"]:
        """Largest value of the noise-free signal, plus :data:`MANY_SIGMA` standard deviations of what is added."""
        return self.largest + MANY_SIGMA * np.sqrt(self.variance)


EVERY_SAMPLE = "changes every sample"
"""Reason for which a kind with a stage in the sensor's chain is beyond sums and law, unless it says otherwise."""


class ErrorKind:
    """One kind of error on the targets that it can act on.

    To define a subclass with a ``name`` is to register it for experiment files. Kinds have no state; their methods take
    one source (or all sources of the kind on a signal) and are pure functions of arrays.
    """

    name: ClassVar[str] = ""
    """Name of the kind, as ``kind`` in ``[[source]]``."""

    def __init_subclass__(cls) -> None:
        """Freeze the kind's tables, tell how it is drawn, and register it on each of its targets.

        Raises:
            TypeError: it is noise that does not say which.
        """
        for table in ("targets", "perturbs", "sizes"):
            setattr(cls, table, MappingProxyType(dict(getattr(cls, table))))
        states_noise = cls.noise_parts is not ErrorKind.noise_parts
        if cls.noise and not states_noise:
            raise TypeError(f"{cls.__name__} is noise: define `noise_parts`")
        cls.constant = cls.constant or bool(cls.perturbs)
        cls.noise = states_noise and cls.stage is None
        if cls.name:
            KINDS.update(dict.fromkeys(((target, cls.name) for target in cls.targets), cls()))

    def __setattr__(self, name: str, value: object) -> NoReturn:
        """Refuse an attribute, as a kind has no state."""
        raise AttributeError(f"{type(self).__name__} is frozen: {name} cannot be set")

    # --- what `[[source]]` says of it ---

    targets: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Unit in which the figures are read, by target; a draw in per cent is converted to parts of one."""
    shape: ClassVar[tuple[int, ...]] = (3,)
    """Shape of the draw."""
    written_as: ClassVar[type[DrawFigures]] = DrawFigures
    """Form of the draw's figures in ``[[source]]``."""
    sizes: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Settings that say how large it is, by their keys in ``[[source]]``: each one's unit, ``{}`` for the target's."""

    def keys(self, target: str) -> dict[str, Any]:
        """Return the keys of the kind in ``[[source]]`` that are not drawn: their types, in SI.

        They are its :attr:`sizes`, unless the kind says otherwise.
        """
        units = {key: self.unit_of_size(target, key) for key in self.sizes}
        return {key: Annotated[np.ndarray, figures(unit, self.shape, above=0)] for key, unit in units.items()}

    def unit_of_size(self, target: str, size: str) -> str:
        """Return the unit in which one of :attr:`sizes` is read."""
        return self.sizes[size].format(self.targets[target])

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the figures that are not drawn, in SI, from the values of :meth:`keys`; None: not stated.

        Raises:
            WrongKeyError: values that do not fit.
        """
        return dict(keys)

    def figures(self, target: str) -> DrawFigures:
        """Return how figures of the draw's size are written."""
        return self.written_as(self.targets[target], self.shape)

    # --- what it does ---

    perturbs: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """The field of :class:`uq.sources.constant_errors.Errors` that a constant's draw sets, by target."""
    stage: ClassVar[int | None] = None
    """Place in a sensor's chain, after noise, at which :meth:`sensed` changes the samples; None: it does not."""
    constant: ClassVar[bool] = False
    """Whether an error of this kind is drawn once an experiment: so it is if it :attr:`perturbs` a field."""
    noise: ClassVar[bool] = False
    """Whether an error of this kind is drawn anew at each sample: so it is if :meth:`noise_parts` states noise that is
    no stage's."""
    white: ClassVar[bool] = False
    """Whether the error is noise whose samples are independent, of the source's distribution, so that sums can simulate
    it."""

    def value(self, source: Source, draw: Draw) -> Draw:
        """Return what a constant's draw [SI] adds to the field that it perturbs: linear in it.

        Of the load cell's six channels, a force's or a moment's three.
        """
        return draw

    def noise_parts(self, source: Source, rate: Any) -> Sequence[NoisePart] | None:
        """Return the white noises behind filters that noise consists of, or that a stage acts as; None: of neither.

        All of a kind's noise follows: its draws, its moments in sums, its variance in the law.

        Args:
            source: of this kind; its figures may be traced.
            rate: sample rate [Hz], which may be traced.
        """
        return None

    def sensed(
        self, signal: Float[Array, "3 n"], sources: Sequence[Source], acting: Sequence[Any]
    ) -> Float[Array, "3 n"]:
        """Return what all sources of this kind on one signal make of its samples.

        Args:
            signal: with constant errors and noise, and what kinds of a lower stage made of it.
            sources: of this kind, on this signal.
            acting: of each, whether it acts in the case that is computed: a truth value, often traced.
        """
        return signal

    # --- what trials on sums and the law can take of it ---

    in_sums_as: ClassVar[str] = ""
    """Approximation of the error in sums that tell its effect nearly, in words."""

    def beyond_sums(self, source: Source, signal: SignalRange) -> str | None:
        """Return why sums over samples do not tell a source's effect on a signal, to follow its name; None: they do."""
        return None if self.stage is None else EVERY_SAMPLE

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return what the law of propagation cannot take of a source on a measured signal; None: it takes it."""
        return None if self.stage is None else EVERY_SAMPLE

    # --- what a result says where there is none ---

    absence: ClassVar[str] = ""
    """Assumption of a result without such an error, a clause with ``{}`` for the target; empty: none."""
    acts_as: ClassVar[tuple[str, ...]] = ()
    """Names of other kinds whose assumptions are false, too, with a source of this one."""


KINDS: dict[tuple[str, str], ErrorKind] = {}
"""Every kind by target and name; filled by :mod:`uq.sources.kinds`, and by whatever else defines a kind."""


class RigConstant(ErrorKind):
    """A constant of rig or body that is not as it is believed: a target that is itself a field of the errors."""

    name = "bias"

    def __init_subclass__(cls) -> None:
        """Let each target perturb the field of its name."""
        cls.perturbs = {target: target for target in cls.targets}
        super().__init_subclass__()


def kind_of(target: str, name: str) -> ErrorKind:
    """Return a kind of error on a target.

    Raises:
        ValueError: there is none of this name.
    """
    if kind := KINDS.get((target, name)):
        return kind
    raise ValueError(f"Argument `kind` must be a kind of error on {target}, but is {name!r}.")


def is_declared(target: str, kind: ErrorKind, declared: Iterable[tuple[str, str]]) -> bool:
    """Return whether a source does what a kind does to a target: of this kind, or of another to the same effect.

    Any noise is noise: noise with a memory ends the assumption of no white noise, but not the other way about.
    """
    effects: set[tuple[str, str]] = set()
    for pair in declared:
        other, channel = KINDS[pair], pair[0]
        effects |= _effects(channel, other) | ({("white noise", channel)} if other.noise else set())
    return bool(_effects(target, kind) & effects)


def _effects(target: str, kind: ErrorKind) -> set[tuple[str, str]]:
    """Effects of a kind: names of kinds, the field that it sets, or noise, each with a channel."""
    noise = ("white noise" if kind.white else "noise with a memory") if kind.noise else None
    marks = [kind.name, *kind.acts_as, kind.perturbs.get(target), noise]
    return {(mark, channel) for mark in marks if mark for channel in CHANNELS.get(target, (target,))}


def signal_variance(sources: Iterable[Source], signal: int | None) -> Float[np.ndarray, "3"]:
    """Return the variance that white noise and biases add to a signal, an index in :data:`SIGNALS`, in any motion."""
    added = [
        s.variance if s.white else np.square(s.error_kind.value(s, np.sqrt(s.variance)))
        for s in sources
        if s.signal == signal and (s.white or s.perturbs in BIASES)
    ]
    return sum(added, np.zeros(3))


def normal_noise_variance(sources: Iterable[Source], rate: float) -> Float[np.ndarray, "3"]:
    """Return the variance of normal white noise that sources of one signal add together, at a sample rate [Hz]."""
    variances = (s.white_variance(rate) for s in sources if s.noise and isinstance(s.shape, Normal))
    return sum((variance for variance in variances if variance is not None), np.zeros(3))


def disturbs(other: Source, source: Source) -> bool:
    """Return whether a source's draws change the signal that another source acts on."""
    by_rig = other.signal is None and not source.of_gyro  # the platform, the body and the air act on the load cell
    return other.drawn and (other.signal == source.signal or by_rig)


def on_axes(figures: Any) -> str:
    """Return figures of the axes as text; one where all are the same."""
    texts = [figure if isinstance(figure, str) else significant(figure) for figure in np.ravel(figures)]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)


def strictest(
    stated: Sequence[Any], acting: Sequence[Any], choose: Callable[..., Array], without: Float[Array, "3 1"]
) -> Float[Array, "3 1"]:
    """Return which of several sources' figures counts on each axis: the least or the largest of those that act.

    Args:
        stated: figures of each source, one per axis.
        acting: whether each source acts: a truth value, often traced.
        choose: the least or the largest of two.
        without: what counts when no source acts.
    """
    counting = without
    for figure, acts in zip(stated, acting, strict=True):
        counting = jnp.where(acts, choose(counting, jnp.asarray(figure, without.dtype)[:, None]), counting)
    return counting

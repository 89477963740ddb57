"""Functions that JAX compiles; a command may keep what is compiled, so that its next call traces nothing.

JAX's own cache of compiled code is asked after a function was traced and lowered, which in a short command takes longer
than to run it. Here a program is known by its function, by the shapes of its arrays and by everything else that it is
given. That is enough only for code that a store can know: of other classes and functions, such as a user's own kinds of
error, nothing is kept.
"""

import contextlib
import dataclasses
import functools
import hashlib
import pickle
import re
from collections.abc import Callable, Iterator, Mapping
from types import FunctionType, MappingProxyType
from typing import Any, ClassVar, Generic, ParamSpec, Protocol, TypeVar, runtime_checkable

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache
from jax.sharding import Mesh

from identify.pytree import is_array

Given = ParamSpec("Given")
Result = TypeVar("Result", covariant=True)
Static = tuple[Any, tuple[tuple[type, str, Any], ...]]
"""The structure of a program's arguments, with None in place of each array and all other leaves as they are."""
PACKAGES = frozenset({"identify", "uq"})
"""Packages whose functions a store identifies by their code."""


@runtime_checkable
class Store(Protocol):
    """The place of compiled code, for one state of the code, of the libraries and of the machine."""

    def load(self, name: str) -> bytes | None:
        """Return what was saved under a name; None: nothing, or it is not whole."""

    def save(self, name: str, data: bytes) -> None:
        """Keep data under a name, if that is possible."""


class UnknownCodeError(TypeError):
    """A program depends on code that a store does not know."""


class CompiledProgram(Generic[Given, Result]):
    """A function compiled once for each kind of arguments: ``jax.jit``, with all that is no array static.

    Arrays are traced, all else is compiled in. Use it as a decorator of functions at the top of a module.
    """

    store: ClassVar[Store | None] = None
    """Set by commands alone: code that is edited, or replaced in a test, while a process runs would not be seen."""

    def __init__(self, function: Callable[Given, Result], options: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Wrap a function; ``options`` are the compiler's."""
        functools.update_wrapper(self, function)
        self.function: Callable[..., Any] = function
        self.options = dict(options)

        @functools.wraps(function)
        def of_arrays(static: Static, arrays: list[Any]) -> Any:
            tree, others = static
            following = iter(arrays)
            leaves = [next(following) if leaf is None else leaf for *_, leaf in others]
            args, kwargs = jax.tree.unflatten(tree, leaves)
            return function(*args, **kwargs)

        del of_arrays.__wrapped__
        self.jitted = jax.jit(of_arrays, static_argnums=0, compiler_options=self.options)
        self.loaded: dict[str, Callable[..., Any]] = {}

    def __call__(self, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Call the function."""
        leaves, tree = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if is_array(leaf)]
        static = tree, tuple(_distinct(None if is_array(leaf) else leaf) for leaf in leaves)
        if self.store is None or jax.process_count() > 1 or any(isinstance(x, jax.core.Tracer) for x in arrays):
            return self.jitted(static, arrays)
        try:
            name = self._name(args, kwargs)
        except UnknownCodeError:
            return self.jitted(static, arrays)
        if name not in self.loaded:
            self.loaded[name] = _loaded(self.store.load(name)) or self._compiled(self.store, name, static, arrays)
        return self.loaded[name](arrays)

    def __get__(self, instance: object, owner: type) -> Any:
        """Bind a method to its object."""
        call: Any = self
        return call if instance is None else functools.partial(call, instance)

    def _name(self, args: Any, kwargs: Any) -> str:
        """Name the program: of everything that its code depends on, but for the code itself and what a store knows."""
        config: Any = jax.config
        devices = str(config.jax_default_device), jax.device_count(), jax.devices()[0].device_kind
        settings = config.jax_enable_x64, *devices
        text = repr((described(self.function), sorted(self.options.items()), settings, described((args, kwargs))))
        return hashlib.sha256(text.encode()).hexdigest()

    def _compiled(self, store: Store, name: str, static: Static, arrays: list[Any]) -> Callable[..., Any]:
        """Compile the program for these arguments, and keep it."""
        lowered = self.jitted.lower(static, arrays)
        with _without_jaxs_cache():
            compiled = lowered.compile()
        if (data := _serialized(compiled)) is not None:
            store.save(name, data)
        return compiled


def _distinct(leaf: Any) -> tuple[type, str, Any]:
    """A leaf beside what tells it from those that Python holds for equal: 1, 1.0 and True; 0.0 and -0.0."""
    return type(leaf), repr(leaf) if isinstance(leaf, float) else "", leaf


def described(value: Any) -> Any:
    """Return what of a value decides how a program is compiled, for :func:`repr`: all but the numbers in arrays.

    Raises:
        UnknownCodeError: it is of a class, or a function, that a store does not know.
    """
    if value is None or type(value) in (bool, int, float, complex, str, bytes):
        return value
    if is_array(value):
        placed = f"{value.sharding}" if isinstance(value, jax.Array) and value.committed else ""
        return "array", str(value.dtype), value.shape, bool(getattr(value, "weak_type", False)), placed
    if isinstance(value, CompiledProgram):
        return described(value.function)
    if isinstance(value, (FunctionType, type)):
        if "<" in value.__qualname__ or value.__module__.split(".")[0] not in PACKAGES:
            raise UnknownCodeError(f"{value.__module__}.{value.__qualname__}")
        return value.__module__, value.__qualname__
    if isinstance(value, np.dtype):
        return "dtype", str(value)
    if isinstance(value, dict):
        return "dict", [(described(key), described(value[key])) for key in sorted(value)]
    if isinstance(value, frozenset):
        return "frozenset", sorted(map(repr, map(described, value)))
    if type(value) in (tuple, list):
        return type(value).__name__, [described(item) for item in value]
    if isinstance(value, tuple):  # a NamedTuple
        return described(type(value)), [described(item) for item in value]
    if isinstance(value, Mesh):
        return "mesh", value.axis_names, str(value.axis_types), value.devices.shape, list(map(str, value.devices.flat))
    if dataclasses.is_dataclass(value):
        fields = [(field.name, described(getattr(value, field.name))) for field in dataclasses.fields(value)]
        return described(type(value)), fields, [described(of) for of in getattr(value, "acting_classes", ())]
    raise UnknownCodeError(f"{type(value)}")


@contextlib.contextmanager
def _without_jaxs_cache() -> Iterator[None]:
    """Let JAX compile: serialized again, what its cache has loaded lacks functions (XLA of JAX 0.10)."""
    config: Any = jax.config
    enabled = config.jax_enable_compilation_cache
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()  # it asks whether it is enabled once
    try:
        yield
    finally:
        jax.config.update("jax_enable_compilation_cache", enabled)
        compilation_cache.reset_cache()


def _serialized(compiled: Any) -> bytes | None:
    """A compiled program as bytes, with all that loads it again; None: it calls what a new process may lack."""
    from jax.experimental.serialize_executable import serialize

    calls = set(re.findall(r'custom_call_target="([^"]*)"', compiled.as_text()))
    if not all(name.startswith("lapack_") for name in calls):
        return None
    try:
        payload, given, results = serialize(compiled)
    except (NotImplementedError, ValueError):  # it holds arrays, or this kind of device has no form for it
        return None
    placed = jax.tree.leaves((compiled.input_shardings, compiled.output_shardings))
    devices = sorted({device.id for sharding in placed for device in sharding.device_set})
    examples = [jax.tree.unflatten(tree, range(tree.num_leaves)) for tree in (given, results)]
    return pickle.dumps((payload, devices, examples, bool(calls)))


def _loaded(data: bytes | None) -> Callable[..., Any] | None:
    """The program that :func:`_serialized` has written; None: there is none, or it cannot be loaded."""
    if data is None:
        return None
    from jax.experimental.serialize_executable import deserialize_and_load

    payload, numbers, examples, calls = pickle.loads(data)  # noqa: S301 - of this user's own cache folder
    if calls:  # JAX finds LAPACK when it lowers the first call, and a program that calls it before ends the process
        jax.jit(jax.lax.linalg.cholesky).lower(np.eye(1))
    devices = [device for device in jax.devices() if device.id in numbers]
    try:
        given, results = map(jax.tree.structure, examples)
        return deserialize_and_load(payload, given, results, execution_devices=devices)
    except (RuntimeError, ValueError):
        return None

"""Trials in stretches: batched, sharded over devices, the same numbers however they are cut."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

from uq.gram_sums.setup import Setup
from uq.trials.collapsed import CollapsedSetup, collapsed_trials
from uq.trials.distributed import guarded, own_share, several
from uq.trials.samplewise import AnySetup, SampledSetup, sampled_trial
from uq.trials.trial import TrialEstimates, trials

T = TypeVar("T")
STRETCH, COLLAPSED_STRETCH = 100, 5000
"""About how many trials a device does between two reports of progress, on samples and on drawn sums."""

Keep = Callable[[int, TrialEstimates], None]
"""Called with the number of a stretch's first trial and its estimates: those that this process computed."""


def run_trials(
    setup: AnySetup,
    trials: int,
    seed: int,
    devices: Sequence[jax.Device],
    batch: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> TrialEstimates:
    """Run trials 0 … ``trials`` - 1 spread over devices; return NumPy arrays with the trials on the leading axis."""
    run = Trials(setup, seed, devices, batch)
    run.reach(trials, progress)
    return run.estimates(trials)


class Trials:
    """The trials of one setup so far, and more of them when they are asked for."""

    def __init__(
        self,
        setup: AnySetup,
        seed: int,
        devices: Sequence[jax.Device],
        batch: int = 1,
        *,
        done: Sequence[TrialEstimates] = (),
        keep: Keep | None = None,
    ) -> None:
        """Start from the stretches that are ``done``; ``keep`` is given each further one."""
        self.batch, self.keep, self.devices = batch, keep, list(devices)
        self.mesh = Mesh(np.array(devices), ("trials",), axis_types=(AxisType.Auto,))
        self.setup, self.key = setup, jax.random.key(seed)
        if several():
            self.setup, data = _everywhere((setup, jax.random.key_data(self.key)), self.mesh)
            self.key = jax.random.wrap_key_data(data)
        self.pending: TrialEstimates | None = None
        self.parts = list(done)
        self.count = sum(len(part.ok) for part in self.parts)

    def reach(
        self, trials: int, progress: Callable[[int, int], None] | None = None, *, asked: int | None = None
    ) -> None:
        """Run whole stretches until there are at least so many trials of those that are ``asked`` for in the end."""
        asked = trials if asked is None else asked
        stretch = self._stretch(asked)
        while self.count < trials:
            begun = self._begin(stretch) if self.pending is None else self.pending
            with guarded():
                part = jax.tree.map(np.asarray, begun)
            self.pending = None
            if self.keep:
                self.keep(*own_share(self.devices, self.count, part))
            self.parts.append(part)
            self.count += stretch
            if progress:
                progress(min(self.count, asked), asked)

    def begin(self, asked: int) -> None:
        """Set the devices to work on the next stretch, that :meth:`reach` waits for, while others are prepared."""
        if self.count < asked and not several():
            self.pending = self._begin(self._stretch(asked))

    def _stretch(self, asked: int) -> int:
        least = COLLAPSED_STRETCH if isinstance(self.setup, CollapsedSetup) else STRETCH
        return stretch_of(self.devices, self.batch, asked, least)

    def _begin(self, stretch: int) -> TrialEstimates:
        numbers = np.arange(self.count, self.count + stretch)
        split = jnp.asarray(numbers)
        if several():
            placed = NamedSharding(self.mesh, PartitionSpec("trials"))
            split = jax.make_array_from_callback(numbers.shape, placed, lambda own: numbers[own])
        with guarded():
            return _batch(self.setup, self.key, split, self.mesh, self.batch, several())

    def estimates(self, trials: int) -> TrialEstimates:
        """Return the first so many trials."""
        return self.between(0, trials)

    def between(self, first: int, last: int) -> TrialEstimates:
        """Return trials ``first`` … ``last`` - 1, which must be done."""
        ends = np.cumsum([len(part.ok) for part in self.parts])
        one, two = np.searchsorted(ends, first, side="right"), np.searchsorted(ends, last)
        before = int(ends[one] - len(self.parts[one].ok))
        return jax.tree.map(
            lambda *leaves: np.concatenate(leaves)[first - before : last - before], *self.parts[one : two + 1]
        )


def stretch_of(devices: Sequence[jax.Device], batch: int, asked: int, least: int = STRETCH) -> int:
    """Return how many trials are done between two reports of progress: whole batches, about ``least`` a device."""
    whole = batch * max(1, least // batch)
    return min(whole, -(-asked // len(devices))) * len(devices)


def _everywhere(tree: T, mesh: Mesh) -> T:
    """Give every device of all processes what each process has computed for itself."""
    arrays, static = eqx.partition(tree, eqx.is_array)
    placed = NamedSharding(mesh, PartitionSpec())
    arrays = jax.tree.map(np.asarray, arrays)
    arrays = jax.tree.map(lambda x: jax.make_array_from_callback(x.shape, placed, lambda own: x[own]), arrays)
    return eqx.combine(arrays, static)


WIDE = {"xla_cpu_prefer_vector_width": 512}
"""Lets a processor use its widest vectors, which XLA by default does not; others take no notice."""


@eqx.filter_jit(compiler_options=WIDE)  # type: ignore[call-overload]
def _batch(
    setup: AnySetup, key: jax.Array, numbers: jax.Array, mesh: Mesh, batch: int, gathered: bool
) -> TrialEstimates:
    """Trials spread over the mesh; ``gathered``: every process is given all results."""

    def on_one_device(setup, key, mine):
        at_once = mesh.devices.flat[0].platform != "cpu"
        if isinstance(setup, SampledSetup):
            one = lambda index: sampled_trial(setup, key, index)  # noqa: E731
            found = jax.lax.map(one, mine, batch_size=batch if at_once else None)
        else:
            found = _whole_batches(setup, key, mine, batch, at_once=at_once)
        return jax.lax.all_gather(found, "trials", tiled=True) if gathered else found

    arrays, static = eqx.partition(setup, eqx.is_array)
    everywhere, split = PartitionSpec(), PartitionSpec("trials")
    sharded = jax.shard_map(
        lambda arrays, key, mine: on_one_device(eqx.combine(arrays, static), key, mine),
        mesh=mesh,
        in_specs=(everywhere, everywhere, split),
        out_specs=everywhere if gathered else split,
        check_vma=False,
    )
    return sharded(arrays, key, numbers)


def _whole_batches(
    setup: Setup | CollapsedSetup, key: jax.Array, mine: jax.Array, batch: int, *, at_once: bool
) -> TrialEstimates:
    """Run trials that are computed many at a time; the last batch is filled up with trials that nobody asked for."""
    size = min(batch, len(mine))
    count = -(-len(mine) // size)

    def run(some: jax.Array) -> TrialEstimates:
        if isinstance(setup, CollapsedSetup):
            return collapsed_trials(setup, key, some)
        return trials(setup, key, some, at_once=at_once)

    found = jax.lax.map(run, jnp.resize(mine, (count, size)))
    return jax.tree.map(lambda leaf: leaf.reshape(count * size, *leaf.shape[2:])[: len(mine)], found)

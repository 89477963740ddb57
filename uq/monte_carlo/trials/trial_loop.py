"""The Monte Carlo loop: batches of trials over devices and processes, resumable; the same numbers for any split.

Whatever is repeated with other draws runs here: campaigns and budgets (:mod:`uq.monte_carlo.trials.engine`), systematic
errors of recorded runs (:mod:`uq.runs.identification.systematic_errors`), redraws of a model's inputs
(:mod:`uq.analysis.sensitivity.redraws`), blocks of an adaptive propagation
(:mod:`uq.analysis.propagation.propagation_of_distributions`).

What runs is a function of the problem, the campaign's key and the numbers of some trials. It draws by these numbers
alone and returns arrays with the trials on the leading axis; a trial that fails is NaN there, and is counted by
:func:`finite_trials`.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, Float, Int, Key, UInt32

from uq.monte_carlo.trials.joined_processes import guarded, several

Tree = TypeVar("Tree")
Progress = Callable[[int, int], None]
"""Called with the trials done and the trials asked for."""
SEGMENT = 100
"""Number of trials, roughly, that a device does between two reports of progress, where each holds samples."""


OVERFLOW = 1e60
"""Size of a result from which on sums of fourth powers are no numbers."""
RunTrials = Callable[[Any, Key[Array, ""], Int[Array, " trials"]], Any]
"""Runs a batch of trials on one device, from problem, key and numbers of the trials, which lead in what it returns.

It is a pure function at the top of a module, so that it is compiled once. Where it calls LAPACK in batches
(eigenvalues, decompositions), give the loop one device: on several of one processor these calls deadlock.
"""


class TrialLoop:
    """The trials of one problem so far, as any tree of arrays; more are run on request."""

    def __init__(
        self,
        run: RunTrials,
        problem: Any,
        seed: int,
        *,
        devices: Sequence[jax.Device] | None = None,
        batch: int = 1,
        segment: int = SEGMENT,
        done: Sequence[Any] = (),
        keep: Callable[[int, Any], None] | None = None,
    ) -> None:
        """Start from what is done.

        Args:
            run: what runs a batch.
            problem: what it is given: arrays, and whatever else is compiled in.
            seed: seed of every draw.
            devices: devices to spread the trials over; None for all.
            batch: trials that one device computes at a time.
            segment: about how many it computes between two reports of progress.
            done: results of the first trials, segment by segment.
            keep: called with the number of each further segment's first trial and its results.
        """
        self.run, self.batch, self.segment, self.keep = run, batch, segment, keep
        self.devices = list(devices or jax.devices())
        self.mesh = Mesh(np.array(self.devices), ("trials",), axis_types=(AxisType.Auto,))
        data: Any = key_data(seed)
        self.problem = problem
        if several():
            self.problem, data = _everywhere((problem, data), self.mesh)
        self.key = jax.random.wrap_key_data(data)
        self.segments = list(done)
        self.count = sum(map(trials_in, self.segments))

    def reach(self, trials: int, progress: Progress | None = None, *, asked: int | None = None) -> None:
        """Run whole segments until there are at least so many trials of those that are ``asked`` for in the end."""
        asked = trials if asked is None else asked
        segment = self._segment(asked)
        while self.count < trials:
            segment_results = self._run(segment)
            if self.keep:
                self.keep(self.count, segment_results)
            self.segments.append(segment_results)
            self.count += trials_in(segment_results)
            if progress:
                progress(min(self.count, asked), asked)

    def _segment(self, asked: int) -> int:
        """Trials between two reports of progress: whole batches, about ``segment`` a device."""
        per_device = self.batch * max(1, self.segment // self.batch)
        return min(per_device, -(-asked // len(self.devices))) * len(self.devices)

    def _run(self, segment: int) -> Any:
        numbers, shards = np.arange(self.count, self.count + segment), NamedSharding(self.mesh, PartitionSpec("trials"))
        split = jax.make_array_from_callback(numbers.shape, shards, lambda share: numbers[share])
        with guarded():
            results = _sharded(
                self.run, self.problem, self.key, split, mesh=self.mesh, batch=self.batch, gathered=several()
            )
            return jax.tree.map(np.asarray, results)

    def results(self, last: int, first: int = 0) -> Any:
        """Return trials ``first`` … ``last`` - 1, which must be done, as NumPy arrays, trials leading.

        A number of ``OVERFLOW`` or more is a failed trial's: NaN.
        """
        ends = np.cumsum([trials_in(segment_results) for segment_results in self.segments])
        begin, end = np.searchsorted(ends, first, side="right"), np.searchsorted(ends, last)
        before = int(ends[begin] - trials_in(self.segments[begin]))

        def joined(*leaves: np.ndarray) -> np.ndarray:
            values = np.concatenate(leaves)[first - before : last - before]
            if values.dtype.kind != "f":
                return values
            return np.where(np.abs(values, dtype=float) < OVERFLOW, values, np.nan)  # float32 does not hold the limit

        return jax.tree.map(joined, *self.segments[begin : end + 1])


def all_trials(
    run: RunTrials, problem: Any, trials: int, seed: int, *, progress: Progress | None = None, **options: Any
) -> Any:
    """Run trials 0 … ``trials`` - 1; return NumPy arrays, trials leading. Options are those of :class:`TrialLoop`."""
    loop = TrialLoop(run, problem, seed, **options)
    loop.reach(trials, progress)
    return loop.results(trials)


def key_data(seed: int) -> UInt32[np.ndarray, "2"]:
    """Return the words of ``jax.random.key(seed)``, for which JAX would compile a program."""
    return np.array([seed >> 32 & 0xFFFFFFFF, seed & 0xFFFFFFFF], np.uint32)


def finite_trials(values: Float[np.ndarray, "trials *outputs"]) -> tuple[Float[np.ndarray, "good *outputs"], int]:
    """Return the trials without a NaN or infinity, and how many have one: those that failed."""
    good = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    return (values if good.all() else values[good]), int(np.sum(~good))


def trials_in(results: Any) -> int:
    """Return how many trials there are in results, arrays with the trials leading."""
    return len(jax.tree.leaves(results)[0])


def _everywhere(tree: Tree, mesh: Mesh) -> Tree:
    """Give every device of all processes what each process has computed for itself."""
    sharding = NamedSharding(mesh, PartitionSpec())
    arrays = jax.tree.map(np.asarray, tree)
    return jax.tree.map(lambda x: jax.make_array_from_callback(x.shape, sharding, lambda share: x[share]), arrays)


OLDER_LOOPS = {"xla_cpu_use_fusion_emitters": False} if jax.__version_info__ < (0, 11, 1) else {}
"""XLA's older way to write a loop, where it still has one: the same speed, compiled in two thirds of the time."""
COMPILER = {"xla_cpu_prefer_vector_width": 512, **OLDER_LOOPS}
"""Options for processors; others take no notice. The widest vectors, which XLA by default does not use."""

RUN_ONCE = {"xla_backend_optimization_level": 0, **OLDER_LOOPS}
"""Options of XLA for what runs once: it takes milliseconds to run, but with every optimisation a second to compile."""


def _on_mesh(
    run: RunTrials, problem: Any, key: jax.Array, numbers: jax.Array, mesh: Mesh, batch: int, gathered: bool
) -> Any:
    """Trials spread over the mesh; ``gathered``: every process is given all results."""

    def on_one_device(problem, key, mine):
        results = _in_batches(lambda indices: run(problem, key, indices), mine, batch)
        return jax.lax.all_gather(results, "trials", tiled=True) if gathered else results

    everywhere, split = PartitionSpec(), PartitionSpec("trials")
    sharded = jax.shard_map(
        on_one_device,
        mesh=mesh,
        in_specs=(everywhere, everywhere, split),
        out_specs=everywhere if gathered else split,
        check_vma=False,
    )
    return sharded(problem, key, numbers)


_sharded = jax.jit(_on_mesh, static_argnames=("run", "mesh", "batch", "gathered"), compiler_options=COMPILER)


def _in_batches(run: Callable[[jax.Array], Any], mine: jax.Array, batch: int) -> Any:
    """Run one batch after the other; the last is filled up with repeated trials, which are dropped."""
    size = min(batch, len(mine))
    count = -(-len(mine) // size)
    # filled up by repetition, so that all batches have one shape and one program; a draw depends on its trial's
    # number, so that repeated trials change nothing
    results = jax.lax.map(run, jnp.resize(mine, (count, size)))
    return jax.tree.map(lambda leaf: leaf.reshape(count * size, *leaf.shape[2:])[: len(mine)], results)

"""Trials by samples: the chain from truth to record to tensor, for any kind of error; the oracle of trials on sums.

Body, platform and air give the true wrench and angular velocity; the sensor sees them in its own axes, with cross-talk,
through its scale factors, at an earlier instant (delay); noise, bias and drift are added; its range ends (saturation);
its resolution is finite (quantisation). The record is whole; its features and their sums are made block by block, which
stay in a processor's cache. ``docs/reference_trial.py`` is the same without blocks.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.least_squares.gram import Sums, solve
from identify.motion.trajectory import Trajectory
from identify.pytree import static_field
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import features
from identify.signals.differentiate import derivative
from uq.monte_carlo.gram_sums.cases import Case, Estimator, cases_of
from uq.monte_carlo.gram_sums.error_maps import OF_MOTION, Platform, WrenchBasis, gyro_map
from uq.monte_carlo.trials.acting_errors import columns_of
from uq.monte_carlo.trials.engine import Engine, Estimates, TrialSetting
from uq.sources.constant_errors import Errors, errors_of_cases, no_errors, perturbed
from uq.sources.draws import BLOCK, Mixing, draw_constants, noise_at_rest, noise_of_block, noise_streams
from uq.sources.random_normals import in_order
from uq.sources.source import Source

NONE: Mapping[str, Array] = MappingProxyType({})


class SamplesEngine(Engine):
    """An experiment on one trajectory with every sample of its noise-free run."""

    body: Body
    platform: Platform
    trajectory: Trajectory
    """The rotation, which a delayed gyro reads at other instants."""
    t: Float[Array, " n"]
    """Instants of the samples [s]."""
    omega: Float[Array, "3 n"]
    """True angular velocity [rad/s]."""
    wrench: Float[Array, "functions n"]
    """True wrench and the other functions of :class:`uq.monte_carlo.gram_sums.error_maps.WrenchBasis`."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    estimators: tuple[Estimator, ...]
    by_act: Mapping[str, Float[Array | np.ndarray, "12 n p"]]
    """Derivatives of force, moment, angular velocity and specific force by the numbers of each source that has no field
    of the errors."""
    basis: WrenchBasis = static_field()
    dtype: np.dtype = static_field()
    """Precision of noise and signals; constant errors, sums over blocks and solutions have the default precision."""
    segment = 100
    """Trials of a segment, after which a checkpoint is written."""

    def batch(self, device: jax.Device) -> int:
        """Return one on a processor, whose cache holds the record of one trial."""
        return 1 if device.platform == "cpu" else 64

    def run(self, key: Key[Array, ""], indices: Int[Array, " trials"]) -> Estimates:
        """Return the estimates of trials, side by side."""
        return jax.vmap(lambda index: sampled_trial(self, key, index))(indices)

    @property
    def rate(self) -> Float[Array, ""]:
        """The rate of the samples [Hz]."""
        return (len(self.t) - 1) / (self.t[-1] - self.t[0])


class SensorRecord(NamedTuple):
    """Readings of the sensors, component first."""

    force: Float[Array, "3 n"]
    """Force that is read [N]."""
    moment: Float[Array, "3 n"]
    """Moment that is read [N·m]."""
    omega: Float[Array, "3 n"]
    """Angular velocity that is read [rad/s]."""


def prepare_samples(
    setting: TrialSetting, cases: Sequence[Case] | None = None, dtype: str = "float64"
) -> SamplesEngine:
    """Keep every sample of a noise-free motion and its wrench; ``cases``: None for all of the breakdown."""
    motion, sources, basis = setting.motion, setting.sources, WrenchBasis.for_sources(setting.sources)
    wrench = basis.sampled(*jax.tree.map(np.asarray, (setting.body, motion)))
    return SamplesEngine(
        cases=tuple(cases or cases_of(sources)), body=setting.body, platform=setting.platform,
        trajectory=setting.trajectory, t=motion.t, omega=motion.omega.astype(dtype),
        wrench=jax.device_put(wrench.astype(dtype)), sources=tuple(sources), mixing=tuple(setting.mixing),
        estimators=tuple(setting.estimators), basis=basis,
        by_act=columns_of(sources, setting.body, setting.platform, motion), dtype=np.dtype(dtype),
    )  # fmt: skip


def sampled_trial(
    engine: SamplesEngine, key: Key[Array, ""], index: Int[Array, ""]
) -> Float[Array, "estimators cases 6"]:
    """Run one trial: its estimates of every case and estimator, from the same draws."""
    # common random numbers: every case and estimator sees the same draws, so that shares do not scatter by them
    draws = draw_constants(engine.sources, engine.mixing, key, index, jnp.result_type(float))
    errors = errors_of_cases(engine.sources, draws, [case.sources for case in engine.cases])
    draws |= draw_noise(engine, key, index)
    acting = [[source.name in case.sources for source in engine.sources] for case in engine.cases]

    # case by case, not side by side: one record of all samples at a time stays in a processor's cache
    def of_case(case: tuple[dict[str, Array], Array]) -> Sums:
        moving, acts = case
        numbers = {s.name: acts[k] * draws[s.name] for k, s in enumerate(engine.sources) if s.name in engine.by_act}
        record = sensed(engine, smooth_signals(engine, no_errors()._replace(**moving), numbers), draws, acts)
        sums = [record_sums(engine, record, estimator) for estimator in engine.estimators]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *sums)

    # what no source sets stays out of the loop, so that the compiler sees its zeros
    moving = {field: getattr(errors, field) for field in perturbed(engine.sources)}
    sums = jax.lax.map(of_case, (moving, np.array(acting)))
    solved = jax.vmap(jax.vmap(solve, in_axes=(0, None)), out_axes=1)
    return solved(sums, engine.body.r_cg_from_q[None] + errors.r_cg).inertia


def draw_noise(engine: SamplesEngine, key: Key[Array, ""], index: Int[Array, ""]) -> dict[str, Float[Array, "3 n"]]:
    """Return every noise source's samples of a trial, by name, in SI."""
    n, noisy = len(engine.t), [source for source in engine.sources if source.noise]
    streams = noise_streams(noisy, key, index)

    def draw(memory, block):
        drawn, memory = noise_of_block(
            sources=noisy, mixing=engine.mixing, streams=streams, memory=memory, block=block, rate=engine.rate,
            dtype=engine.dtype,
        )  # fmt: skip
        return memory, drawn

    # put in order after the loop that draws: within it, XLA would draw anew for each half
    blocks = jax.lax.scan(draw, noise_at_rest(noisy, engine.dtype), jnp.arange(-(-n // BLOCK)))[1]
    ordered = [jax.vmap(in_order, out_axes=1)(drawn).reshape(3, -1)[:, :n] for drawn in blocks]
    return {source.name: noise for source, noise in zip(noisy, ordered, strict=True)}


def smooth_signals(engine: SamplesEngine, errors: Errors, numbers: Mapping[str, Array] = NONE) -> SensorRecord:
    """Return what sensors without noise, of unlimited range and resolution, would record: smooth in the errors.

    Args:
        engine: of the trial.
        errors: of all sources that set one of their fields.
        numbers: draws of the other constant sources, by name, as :func:`by_act` takes them.
    """
    dtype, elapsed = engine.dtype, engine.t - engine.t[0]
    wrench = jnp.matmul(engine.basis.map(engine.body, engine.platform, errors).astype(dtype), engine.wrench)
    wrench = wrench + errors.cell_bias[:, None].astype(dtype)
    omega = engine.omega
    if "gyro_delay" in perturbed(engine.sources):
        omega = jax.vmap(engine.trajectory.omega, out_axes=1)(engine.t - errors.gyro_delay).astype(dtype)
    omega = jnp.matmul(gyro_map(errors).astype(dtype), omega) + jnp.outer(errors.gyro_drift, elapsed).astype(dtype)
    omega = omega + errors.gyro_bias[:, None].astype(dtype)
    added = by_act(engine, numbers)
    return SensorRecord(wrench[:3] + added[:3], wrench[3:] + added[3:6], omega + added[6:9])


def by_act(engine: SamplesEngine, numbers: Mapping[str, Array]) -> Float[Array, "12 n"] | Float[np.ndarray, "12 1"]:
    """Return what sources without a field of the errors add to force, moment, angular velocity and specific force."""
    added = [
        jnp.asarray(engine.by_act[name], engine.dtype) @ jnp.atleast_1d(drawn).astype(engine.dtype)
        for name, drawn in numbers.items()
    ]
    return sum(added[1:], added[0]) if added else np.zeros((12, 1), engine.dtype)


def sensed(
    engine: SamplesEngine, signals: SensorRecord, draws: Mapping[str, Array], acting: Sequence[Any] | Array
) -> SensorRecord:
    """Add noise to signals, then let every kind that has a stage in the sensors' chain act on them.

    Args:
        engine: of the trial.
        signals: smooth.
        draws: the noise of each source, by name.
        acting: of each source, whether it acts.
    """
    measured = []
    for number, signal in enumerate(signals):
        sources = [(s, acts) for s, acts in zip(engine.sources, acting, strict=True) if s.signal == number]
        for source, acts in sources:
            if source.noise:
                signal = signal + jnp.where(acts, draws[source.name], 0)
        kinds = {source.error_kind for source, _ in sources if source.error_kind.stage is not None}
        for kind in sorted(kinds, key=lambda kind: (kind.stage, kind.name)):
            members, acting_members = zip(*((s, acts) for s, acts in sources if s.error_kind is kind), strict=True)
            signal = kind.sensed(signal, members, acting_members)
        measured.append(signal)
    return SensorRecord(*measured)


def record_sums(engine: SamplesEngine, record: SensorRecord, estimator: Estimator) -> Sums:
    """Return an estimator's sums over the samples where all estimators have a derivative, block by block."""
    halo, taps = max(len(e.taps) for e in engine.estimators), estimator.taps.astype(engine.dtype)
    count, lost = len(engine.t) - 2 * halo, halo - len(taps)
    size = min(BLOCK, count)

    def add(total, first):
        start = jnp.minimum(first, count - size)  # the last block overlaps the one before
        fresh = (start + jnp.arange(size) >= first).astype(engine.dtype)
        force, moment, omega = (_cut(signal, start + halo, size) for signal in record)
        alpha = derivative(_cut(record.omega, start + lost, size + 2 * len(taps)), taps)
        phi = features(omega, alpha)[OF_MOTION] * fresh[None]
        # not phi @ rows.T: XLA would write the transposed rows number by number
        products = jnp.einsum("it,jt->ij", phi, jnp.concatenate([phi, force, moment]))
        return total + products.astype(float), None

    sums = jax.lax.scan(add, jnp.zeros((9, 15)), jnp.arange(0, count, size))[0]
    sums = jnp.pad(sums, ((4, 0), (4, 0)))  # Omega_R has no part of 1 and omega
    return Sums(sums[:, :13], sums[:, 13:16], sums[:, 16:])


def _cut(signal: Float[Array, "3 n"], start: Int[Array, ""], size: int) -> Float[Array, "3 {size}"]:
    return jax.lax.dynamic_slice_in_dim(signal, start, size, axis=1)

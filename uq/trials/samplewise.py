"""One trial, sample by sample and case by case: for any source, and the oracle of :mod:`uq.trials.trial`.

The chain from truth to record, in this order: body, platform and air give the true wrench and angular velocity; the
sensor sees them in its own axes, with cross-talk, through its scale factors; noise, bias and drift are added; the
angular velocity is that of an earlier instant (delay); the range ends (saturation); the resolution is finite
(quantisation).
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.estimators.gram import Sums, solve, sums_of
from identify.motion.trajectory import Motion, Trajectory
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import features
from identify.signals.differentiate import derivative
from uq.gram_sums.error_maps import Columns, Platform, gyro_map
from uq.gram_sums.setup import Case, Estimator, cases_of
from uq.sources.constant_errors import Errors, errors_of_cases, perturbed
from uq.sources.draws import BLOCK, Mixing, draw_constants, noise_at_rest, noise_of_block, noise_streams
from uq.sources.random_normals import in_order
from uq.sources.source import Source
from uq.trials.trial import TrialEstimates


class SampledSetup(Pytree):
    """Everything that a trial needs besides its key, with every sample of the noise-free run."""

    body: Body
    platform: Platform
    trajectory: Trajectory
    """The rotation, which a delayed gyro reads at other instants."""
    t: Float[Array, " n"]
    """Instants [s]."""
    omega: Float[Array, "3 n"]
    """True angular velocity [rad/s]."""
    wrench: Float[Array, "columns n"]
    """True wrench and the other functions of :class:`uq.gram_sums.error_maps.Columns`."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    estimators: tuple[Estimator, ...]
    cases: tuple[Case, ...] = static_field()
    columns: Columns = static_field()
    dtype: np.dtype = static_field()
    """Precision of draws and signals; sums and solutions have the default precision."""

    @property
    def rate(self) -> Float[Array, ""]:
        """Sample rate [Hz]."""
        return (len(self.t) - 1) / (self.t[-1] - self.t[0])


class Record(NamedTuple):
    """What the sensors record, component first."""

    wrench: Float[Array, "6 n"]
    """Force [N] and moment [N·m]."""
    omega: Float[Array, "3 n"]
    """Angular velocity [rad/s]."""


def needs_samples(sources: Sequence[Source], mixing: Sequence[Mixing]) -> bool:
    """Whether sums over samples tell only nearly what these sources do, or not at all."""
    return crossed(sources, mixing) or any(s.error_kind.needs_samples for s in sources)


def crossed(sources: Sequence[Source], mixing: Sequence[Mixing]) -> bool:
    """Whether noise of the gyro is correlated with noise of the load cell, which sums over samples do not tell."""
    gyro, cell = ({s.name for s in sources if s.white and s.of_gyro is which} for which in (True, False))
    return any(gyro & set(mix.names) and cell & set(mix.names) for mix in mixing)


def prepare_samples(
    motion: Motion,
    body: Body,
    platform: Platform,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    trajectory: Trajectory,
    mixing: Sequence[Mixing] = (),
    dtype: str = "float64",
    cases: Sequence[Case] | None = None,
) -> SampledSetup:
    """Keep every sample of a noise-free motion and its wrench; ``cases``: None for all of the breakdown."""
    columns = Columns.of(sources)
    wrench = jax.device_put(columns.sampled(*jax.tree.map(np.asarray, (body, motion))))
    return SampledSetup(
        body, platform, trajectory, motion.t, motion.omega, wrench, tuple(sources), tuple(mixing), tuple(estimators),
        tuple(cases or cases_of(sources)), columns, np.dtype(dtype),
    )  # fmt: skip


def sampled_trial(setup: SampledSetup, key: Key[Array, ""], index: Int[Array, ""]) -> TrialEstimates:
    """Run one trial: its estimates of every case and estimator, from the same draws."""
    draws = draw_constants(setup.sources, setup.mixing, key, index, setup.dtype)
    errors = errors_of_cases(setup.sources, draws, [case.sources for case in setup.cases])
    drawn = draws | draw_noise(setup, key, index)
    acting = jnp.asarray([[s.name in case.sources for s in setup.sources] for case in setup.cases]).reshape(
        len(setup.cases), len(setup.sources)
    )

    def of_case(case):
        errors, acting = case
        record = sensed(setup, smooth_signals(setup, errors), drawn, acting)
        sums = [record_sums(setup, record, estimator) for estimator in setup.estimators]
        return [solve(gram, setup.body.r_cg_from_q + errors.r_cg) for gram in sums]

    estimates = jax.lax.map(of_case, (errors, acting))
    return TrialEstimates(jnp.stack([e.inertia for e in estimates]), jnp.stack([e.ok for e in estimates]))


def smooth_signals(setup: SampledSetup, errors: Errors) -> Record:
    """Return what sensors without noise, of unlimited range and resolution, would record: smooth in the errors."""
    wrench = setup.columns.map(setup.body, setup.platform, errors) @ setup.wrench + errors.cell_bias[:, None]
    omega = setup.omega
    if "gyro_delay" in perturbed(setup.sources):
        omega = jax.vmap(setup.trajectory.omega, out_axes=1)(setup.t - errors.gyro_delay)
    drift = jnp.outer(errors.gyro_drift, setup.t - setup.t[0])
    return Record(wrench, gyro_map(errors) @ omega + errors.gyro_bias[:, None] + drift)


def draw_noise(setup: SampledSetup, key: Key[Array, ""], index: Int[Array, ""]) -> dict[str, Float[Array, "3 n"]]:
    """Return the noise of every noise source of a trial, by name."""
    n = len(setup.t)
    sources = [source for source in setup.sources if source.noise]
    streams = noise_streams(sources, key, index)

    def draw(memory, block):
        pairs, memory = noise_of_block(sources, setup.mixing, streams, memory, block, setup.rate, setup.dtype)
        return memory, [in_order(of_source) for of_source in pairs]

    blocks = jax.lax.scan(draw, noise_at_rest(sources, setup.dtype), jnp.arange(-(-n // BLOCK)))[1]
    return {s.name: b.swapaxes(0, 1).reshape(3, -1)[:, :n] for s, b in zip(sources, blocks, strict=True)}


def sensed(setup: SampledSetup, signals: Record, draws: Mapping[str, Array], acting: Sequence[Any] | Array) -> Record:
    """Add noise to signals, then let every kind that has a stage in the sensors' chain act on them.

    Args:
        setup: of the trial.
        signals: smooth.
        draws: what constant sources drew, and the noise of the others, by name.
        acting: of each source, whether it acts.
    """
    smooth = (signals.wrench[:3], signals.wrench[3:], signals.omega)
    measured = []
    for number, signal in enumerate(smooth):
        signal = signal.astype(setup.dtype)
        of_signal = [(s, acts) for s, acts in zip(setup.sources, acting, strict=True) if s.signal == number]
        for source, acts in of_signal:
            if source.noise:
                signal = signal + jnp.where(acts, draws[source.name], 0)
        kinds = {source.error_kind for source, _ in of_signal if source.error_kind.stage is not None}
        for kind in sorted(kinds, key=lambda kind: (kind.stage, kind.name)):
            members, acting_members = zip(*((s, acts) for s, acts in of_signal if s.error_kind is kind), strict=True)
            signal = kind.sensed(signal, members, acting_members, draws)
        measured.append(signal)
    return Record(jnp.concatenate(measured[:2]), measured[2])


def record_sums(setup: SampledSetup, record: Record, estimator: Estimator) -> Sums:
    """Return an estimator's sums over the samples where all estimators have a derivative."""
    halo, n = max(len(e.taps) for e in setup.estimators), record.omega.shape[1]
    lost = halo - len(estimator.taps)
    alpha = derivative(record.omega[:, lost : n - lost], estimator.taps.astype(record.omega.dtype))
    omega, wrench = record.omega[:, halo : n - halo], record.wrench[:, halo : n - halo]
    phi, wrench = features(omega, alpha).astype(float), wrench.astype(float)
    return sums_of(phi, wrench[:3], wrench[3:])

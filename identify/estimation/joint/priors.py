"""The prior of a run's unknowns: means and covariances, as the joint estimate takes them; those of the alignment.

Unknowns are written ``theta = mean + root @ z``: with a prior, z is standard normal; without one (the tensor), z is
free. An unknown of zero uncertainty has no column, so it is neither estimated nor costs anything.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.estimation.joint.joint_model import COUNT, SIZES, SLICES, WANDER, SpecificForce
from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.declared_effects import DeclaredError
from identify.signals.run import RunError


@dataclass(frozen=True)
class Alignment:
    """Prior of the IMU's delay and rotation against the load cell, and of both sensors' slow errors; SI units."""

    delay: float = 0.0
    """Delay of the IMU: time from the measurement of a sample to its stamp [s]."""
    sigma_delay: float = 0.02
    """Standard uncertainty of ``delay`` [s]; 0: known."""
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector of the rotation from the IMU's axes, as declared, to B [rad]."""
    sigma_rotation: float | tuple[float, float, float] = float(np.radians(5))
    """Standard uncertainty of ``rotation`` on each axis [rad]; 0: known."""
    sigma_gyro_bias: float | tuple[float, float, float] = 0.02
    """Standard uncertainty of the gyro's zero [rad/s]."""
    sigma_tilt: float | None = None
    """Standard uncertainty of the attitude at the start, which is level [rad]; None: from the force."""
    sigma_accelerometer_bias: float | tuple[float, float, float] = 0.3
    """Standard uncertainty of the accelerometer's zero [m/s²]."""
    sigma_force_drift: float | tuple[float, float, float] = 0.0
    """Standard uncertainty of a linear change of the force's offset over a run [N]."""
    sigma_moment_drift: float | tuple[float, float, float] = 0.0
    """Standard uncertainty of a linear change of the moment's offset from the run's start to its end [N·m]."""

    def __post_init__(self) -> None:
        """Refuse figures that are not finite, negative uncertainties, and wrong shapes."""
        for name, value in vars(self).items():
            numbers = np.atleast_1d(np.asarray(0.0 if value is None else value, float))
            if not np.isfinite(numbers).all() or (name.startswith("sigma") and (numbers < 0).any()):
                raise RunError(
                    f"{name} of the alignment is {value!r}: give finite numbers, uncertainties not below zero"
                )
            if len(numbers) not in (1, 3) or (len(numbers) == 3 and name in ("delay", "sigma_delay", "sigma_tilt")):
                raise RunError(f"{name} of the alignment has {len(numbers)} numbers: give one, or one per axis")


STATIC = ("mass", "r_cg", "force_offset", "moment_offset")
"""Unknowns that static poses determine, in the order of their covariance."""


class PriorBlock(NamedTuple):
    """Mean and covariance of some unknowns."""

    mean: np.ndarray
    covariance: np.ndarray


class ConstantError(NamedTuple):
    """A declared constant error of the rig: the same in all runs, unless it is drawn for each of them."""

    unknown: str
    """Name of the unknown of :data:`identify.estimation.joint.joint_model.SIZES` that the error changes."""
    mean: np.ndarray
    covariance: np.ndarray
    shared: bool = True
    """Whether the error is the same in all runs."""
    root: np.ndarray | None = None
    """Root of the error's covariance, a column for each independent axis of the source; None: any root will do."""
    correlated_as: str = ""
    """Name of the set of correlated errors whose roots have the same columns as this one's; '': it is independent."""

    @property
    def axes(self) -> np.ndarray:
        """One standard uncertainty of each independent axis, in columns."""
        return root_of(self.covariance) if self.root is None else self.root


def error_blocks(errors: Mapping[str, ConstantError]) -> dict[tuple[str, ...], PriorBlock]:
    """Return the prior of the unknowns that declared errors change; errors of one unknown add.

    Args:
        errors: by the name of their source.
    """
    joined = dict.fromkeys(error.unknown for error in errors.values() if error.correlated_as)
    blocks: dict[tuple[str, ...], PriorBlock] = {}
    for members in correlated(errors).values():
        key = tuple(joined) if members[0].unknown in joined else (members[0].unknown,)
        size = sum(SIZES[unknown] for unknown in key)
        mean, axes = np.zeros(size), np.zeros((size, members[0].axes.shape[1]))
        for member in members:
            here = places_in(key, [member.unknown])
            mean[here] += member.mean
            axes[here] += member.axes
        before = blocks.get(key, PriorBlock(np.zeros_like(mean), np.zeros((len(mean), len(mean)))))
        blocks[key] = PriorBlock(before.mean + mean, before.covariance + axes @ axes.T)
    return blocks


def correlated(errors: Mapping[str, ConstantError]) -> dict[str, list[ConstantError]]:
    """Return the declared errors that are correlated, by the name of their set, and each other one by its own."""
    members: dict[str, list[ConstantError]] = {}
    for name, error in errors.items():
        members.setdefault(error.correlated_as or name, []).append(error)
    return members


def axes_of(errors: Mapping[str, ConstantError]) -> dict[str, tuple[DeclaredError, ...]]:
    """Return what one standard uncertainty of each independent axis changes, by its name, such as ``F_gain 1``.

    An axis of correlated errors changes several unknowns.
    """
    return {
        f"{name} {number + 1}": tuple(DeclaredError(error.unknown, error.axes[:, number]) for error in members)
        for name, members in correlated(errors).items()
        for number in range(members[0].axes.shape[1])
    }


def linked(
    blocks: Mapping[tuple[str, ...], PriorBlock],
    errors: Mapping[str, ConstantError],
    static_effects: Mapping[str, np.ndarray],
) -> dict[tuple[str, ...], PriorBlock]:
    """Return the prior in which the static calibration is correlated with the errors that act on it.

    Where such an error is ``e``, the calibration is off by its effect, so that truth less prior mean is ``e`` for the
    error and minus the effect for what was calibrated.

    Args:
        blocks: without.
        errors: declared errors, which all runs share.
        static_effects: by the name of an error's axis, its effect on ``STATIC``, (10,).
    """
    both = {name: parts for name, parts in axes_of(errors).items() if name in static_effects}
    unknowns = {part.unknown for parts in both.values() for part in parts}
    keys = sorted(key for key in blocks if unknowns & {*key})
    if not keys:
        return dict(blocks)
    members = (STATIC, *keys)
    names = sum(members, ())
    covariance = scipy.linalg.block_diag(*(blocks[member].covariance for member in members))
    fixed = np.arange(len(blocks[STATIC].mean))
    for name, parts in both.items():
        for unknown, axis in parts:
            # truth less prior mean is e for the error and -K e for what was calibrated: Cov = -K Σ, axis by axis
            here, cross = places_in(names, [unknown]), -np.outer(static_effects[name], axis)
            covariance[np.ix_(fixed, here)] += cross
            covariance[np.ix_(here, fixed)] += cross.T
    mean = np.concatenate([blocks[member].mean for member in members])
    others = {key: block for key, block in blocks.items() if key not in members}
    return {names: PriorBlock(mean, covariance), **others}


def means_of(blocks: Mapping[tuple[str, ...], PriorBlock]) -> dict[str, np.ndarray]:
    """Return the prior mean of each unknown of some blocks."""
    return {name: block.mean[places_in(key, [name])] for key, block in blocks.items() for name in key}


def without(blocks: Mapping[tuple[str, ...], PriorBlock], names: Collection[str]) -> dict[tuple[str, ...], PriorBlock]:
    """Return the prior of the unknowns of other names."""
    others = {}
    for key, block in blocks.items():
        remaining = tuple(name for name in key if name not in names)
        places = places_in(key, remaining)
        if remaining:
            others[remaining] = PriorBlock(block.mean[places], block.covariance[np.ix_(places, places)])
    return others


def places_in(key: Sequence[str], names: Iterable[str]) -> np.ndarray:
    """Return the places of some unknowns in a block of unknowns."""
    ends = np.cumsum([0, *(SIZES[name] for name in key)])
    return np.array([k for name in names for k in range(ends[key.index(name)], ends[key.index(name) + 1])], int)


def calibrated(blocks: Mapping[tuple[str, ...], PriorBlock]) -> bool:
    """Whether the prior holds a static calibration."""
    return any(names[: len(STATIC)] == STATIC for names in blocks)


@dataclass(frozen=True)
class Setting:
    """Priors and options of a joint estimate."""

    blocks: Mapping[tuple[str, ...], PriorBlock]
    """Mean and covariance of mass, r_CG, offsets of force and moment; what is correlated, in one block."""
    alignment: Alignment
    """Prior of delay, rotation and slow errors."""
    band: float
    """Highest frequency of the motion [Hz]."""
    specific_force: SpecificForce
    gravity: float
    """Local gravity that is stated [m/s²]."""
    scale: float = 1.0
    """Order of magnitude of the tensor [kg·m²]."""
    flat: tuple[str, ...] = ("inertia",)
    """Unknowns without a prior; what is stated of them is only where the search starts, and their size."""
    errors: Mapping[str, ConstantError] = field(default_factory=dict)
    """Declared constant errors by the name of their source; ``blocks`` hold them too."""
    drawn_by_mounting: frozenset[str] = frozenset()
    """Unknowns that each mounting draws independently."""
    lasting: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Errors of the static calibration that are the same in another body's result, by name, in the order of
    ``STATIC``."""


@dataclass(frozen=True, eq=False)
class Prior:
    """The prior of all unknowns of one run."""

    mean: Float[np.ndarray, " count"]
    root: Float[np.ndarray, "count free"]
    counted: Float[np.ndarray, " free"]
    """Prior precision of each coordinate z: 1 where it is standard normal, 0 where it has no prior."""

    def theta(self, z: Float[np.ndarray, " free"]) -> Float[np.ndarray, " count"]:
        """Return the unknowns of z."""
        return self.mean + self.root @ z

    def coordinates(self, values: Mapping[str, np.ndarray | float]) -> Float[np.ndarray, " free"]:
        """Return the coordinates of unknowns with some values, the others at their mean."""
        theta = self.mean.copy()
        for name, value in values.items():
            theta[SLICES[name]] = value
        return np.linalg.lstsq(self.root, theta - self.mean, rcond=None)[0]

    @property
    def covariance(self) -> np.ndarray:
        """Prior covariance of the unknowns, (count, count); zero for those without a prior."""
        root = self.root * self.counted
        return root @ root.T


def run_prior(setting: Setting, gyro_density: np.ndarray) -> Prior:
    """Return the prior of one run.

    Args:
        setting: of the estimate.
        gyro_density: density of the gyro's white noise on each axis [rad/s^0.5].
    """
    alignment = setting.alignment
    wander = setting.specific_force == "still"  # the attitude is integrated, so that the gyro's noise makes it wander
    sigma = {
        "inertia": setting.scale,
        "gyro_bias": alignment.sigma_gyro_bias,
        "tilt": (1.0 if alignment.sigma_tilt is None else alignment.sigma_tilt) if wander else 0.0,
        "delay": alignment.sigma_delay,
        "rotation": alignment.sigma_rotation,
        "accelerometer_bias": 0.0 if wander else alignment.sigma_accelerometer_bias,
        "force_drift": alignment.sigma_force_drift,
        "moment_drift": alignment.sigma_moment_drift,
        "wander": np.tile(gyro_density, WANDER) if wander else 0.0,
    }
    mean, spread = np.zeros(COUNT), np.zeros((COUNT, COUNT))
    mean[SLICES["delay"]], mean[SLICES["rotation"]] = alignment.delay, alignment.rotation
    for name, value in sigma.items():
        spread[SLICES[name], SLICES[name]] = np.diag(np.broadcast_to(value, SIZES[name]))
    for names, block in setting.blocks.items():
        where = indices(names)
        mean[where] = block.mean
        spread[np.ix_(where, where)] = root_of(block.covariance)
    # θ = mean + root z: what is exact has no column, so that it is no unknown of the search either
    free = np.flatnonzero(np.abs(spread).max(axis=0) > 0)
    counted = 1.0 - np.isin(free, indices(setting.flat))
    return Prior(mean, spread[:, free], counted)


def indices(names: Iterable[str]) -> np.ndarray:
    """Return the indices of named unknowns in the vector of all."""
    return np.concatenate([np.zeros(0, int), *(np.arange(COUNT)[SLICES[name]] for name in names)])

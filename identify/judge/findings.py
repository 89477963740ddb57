"""Texts on a cause: its size in the units of a laboratory, and its cure."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.evidence import Evidence
from identify.rounding import significant, with_uncertainty

ROUNDING = 1e-9
"""Uncertainty over the largest of a cause's coefficients below which a coefficient is left at zero."""


class Words(NamedTuple):
    """Texts of a cause: size and cure."""

    phrase: Callable[[Float[np.ndarray, " p"], Float[np.ndarray, " p"]], str]
    """Function that makes a phrase of the coefficients in SI and their standard uncertainties."""
    cure: str


def signed(value: float) -> str:
    """Return a number of two digits with its sign."""
    return significant(value, 2, signed=True)


def _figures(scale: float, unit: str) -> Callable[[np.ndarray, np.ndarray], str]:
    def write(values: np.ndarray, spread: np.ndarray) -> str:
        seen = spread > ROUNDING * spread.max()  # the others change nothing of what is compared
        pairs = zip(scale * values[seen], abs(scale) * spread[seen], strict=True)
        numbers = ", ".join(with_uncertainty(value, u) for value, u in pairs)
        return f"{numbers} {unit}" if len(values) == 1 else f"({numbers}) {unit}"

    return write


def _as(pattern: str, scale: float = 1.0, unit: str = "") -> Callable[[np.ndarray, np.ndarray], str]:
    figures = _figures(scale, unit)
    return lambda values, spread: pattern.format(figures(values, spread))


def _largest(pattern: str, scale: float, unit: str) -> Callable[[np.ndarray, np.ndarray], str]:
    def write(values: np.ndarray, spread: np.ndarray) -> str:
        return pattern.format(f"{significant(scale * float(np.abs(values).max()), 2)} {unit}".rstrip())

    return write


def _only(text: str) -> Callable[[np.ndarray, np.ndarray], str]:
    return lambda values, spread: text


def _flexible(values: np.ndarray, spread: np.ndarray) -> str:
    softest = float(values.max())
    if softest <= 0:
        return "as if body or load cell bent under it (flexible mounting)"
    frequency = significant(1 / (2 * np.pi * np.sqrt(softest)), 2)
    return f"as if the body bent on its mounting, at about {frequency} Hz (flexible mounting)"


def _cable(values: np.ndarray, spread: np.ndarray) -> str:
    parts = ((values[:-9], "N/rad"), (values[-9:], "N·m/rad"))  # of a free body there is no force to compare
    sizes = [f"{significant(float(np.abs(part).max()), 2)} {unit}" for part, unit in parts if part.size]
    return f"as if a cable pulled with up to {' and '.join(sizes)} (cable)"


def _filter(values: np.ndarray, spread: np.ndarray) -> str:
    if (values < 0).all():
        return f"as if the IMU came late by {_figures(-1e3, 'ms')(values, spread)} against force and moment (filter)"
    return f"as if force and moment came late by {_figures(1e3, 'ms')(values, spread)} (filter)"


ESTIMATED = ", or let method joint estimate it"

WORDS: Mapping[str, Words] = {
    "delay": Words(
        _as("as if the angular velocity came late by {} (delay)", 1e3, "ms"), f"declare the delay{ESTIMATED}"
    ),
    "rotation": Words(
        _as("as if the IMU were turned against the load cell by {} (rotation)", 180 / np.pi, "deg"),
        "correct imu_rotation_to_body or wrench_rotation_to_body",
    ),
    "centre of gravity": Words(
        _as("as if r_CG were off by {} (centre of gravity)", -1e3, "mm"), "correct r_cg_from_q, or record static poses"
    ),
    "mass": Words(_as("as if the mass were off by {} (mass)", -1.0, "kg"), "weigh the body, or check the force's gain"),
    "still missed": Words(
        _as("as if the centre of gravity were off the point at rest by {} (still missed)", 1e3, "mm"),
        "declare r_cg_from_omb with its uncertainty",
    ),
    "gyro scale": Words(
        _as("as if the gyro's scale factors were wrong by {} (gyro scale)", -100.0, "%"),
        "calibrate it, or declare a scale",
    ),
    "gyro bias": Words(
        _largest("as if the gyro's zero changed by {} (gyro bias)", 1e3, "mrad/s²"),
        "let it warm up, or declare a drift",
    ),
    "gyro axes": Words(
        _as("as if the gyro were turned against the accelerometer by {} (gyro axes)", 180 / np.pi, "deg"),
        "calibrate it, or declare a misalignment",
    ),
    "gyro g-sensitivity": Words(
        _largest("as if acceleration feigned angular velocity, {} (gyro g-sensitivity)", 1e3, "mrad/s per m/s²"),
        "use the gyro's calibration",
    ),
    "gain": Words(
        _as("as if the load cell's gains were wrong by {} (gain)", 100.0, "%"), "calibrate it, or declare a scale"
    ),
    "cross-talk": Words(
        _only("as if components of the load cell leaked into each other (cross-talk)"),
        "use its calibration matrix, or declare the cross_talk",
    ),
    "drift": Words(_only("as if the load cell's zeros drifted (drift)"), "let it warm up, or declare a drift"),
    "jump": Words(_only("as if the load cell's zeros jumped (jump)"), "record again"),
    "slip": Words(_largest("as if the body slipped by {} (slip)", 1e3, "mm"), "clamp it, and record again"),
    "gain drift": Words(
        _as("as if the load cell's gains changed by {} over the run (gain drift)", 100.0, "%"), "let it warm up"
    ),
    "cable": Words(_cable, "lay it loosely, or carry it along"),
    "air": Words(_only("as if air or friction held the body back (air)"), "turn more slowly"),
    "flexible mounting": Words(_flexible, "stiffen it, or move more slowly"),
    "tensor": Words(_only("as if the tensor changed during the run: something moves (tensor)"), "fix what moves"),
    "accelerometer place": Words(
        _as("as if the accelerometer stood elsewhere by {} (accelerometer place)", 1e3, "mm"), "correct imu_position"
    ),
    "accelerometer scale": Words(
        _as("as if the accelerometer's scale factors were wrong by {} (accelerometer scale)", -100.0, "%"),
        "calibrate it",
    ),
    "clock": Words(_as("as if the IMU's clock ran off by {} over the run (clock)", 1e3, "ms"), "check the stamps"),
    "filter": Words(_filter, "give both sensors the same filter, or declare the delay" + ESTIMATED),
    "nonlinearity": Words(
        _only("as if the load cell were not linear (nonlinearity)"), "use its calibration, or load it less"
    ),
}
"""Texts of each cause, by the cause's name."""


def sentence(judged: Evidence, rivals: tuple[str, ...], quantity: str) -> str:
    """Return what the residuals follow, and the cure.

    Args:
        judged: the cause with its evidence.
        rivals: causes that are about as probable.
        quantity: words for what was measured: force and moment, or the moment alone.
    """
    words = WORDS[judged.cause.name]
    size = judged.cause.size
    spread = size * np.sqrt(np.maximum(np.diag(judged.covariance), 0.0))
    also = f"; as probable: {', '.join(rivals)}" if rivals else ""
    verb = "looks" if quantity == "the moment" else "look"
    return f"{quantity} {verb} {words.phrase(size * judged.coefficients, spread)}{also}; {words.cure}"

"""The prior of delay and rotation between load cell and IMU, and of both sensors' slow errors."""

from dataclasses import dataclass

import numpy as np

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
                raise RunError(f"{name} of the alignment has {len(numbers)} numbers: give one, or one an axis")

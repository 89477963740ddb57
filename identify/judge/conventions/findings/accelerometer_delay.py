"""The accelerometer lags behind the gyro.

## What it looks like

Force and gyro fit each other, and only an accelerometer that is read some milliseconds later. (Beside a declared rig
method `joint` names the same as a cause, with its size.)

## Why it matters

Mass, centre of gravity and the axes follow from the specific force. A lag may look like weight that is missing.
Methods `source` and `gls` do not use the accelerometer.

## How it is decided

The weight along the axes at rest is fitted with either delay free. The accelerometer's own must explain the force far
better than anything else that is looked for. A delay of the whole IMU is the cause `delay`.

## What to do

Set `accelerometer_delay` in `[recording]`, or give gyro and accelerometer the same filter, which is better.
"""

from identify.display.rounding import fixed
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding


class AccelerometerLags(Finding):
    """An accelerometer whose samples are older than the gyro's."""

    lag: float
    """Time by which it lags [s]."""

    @property
    def _delay(self) -> str:
        return f"{fixed(1e3 * self.lag, 1)} ms"

    @property
    def looks(self) -> str:
        return f"force and gyro fit only an accelerometer that lags behind them by {self._delay}"

    @property
    def cure(self) -> Cure:
        delay = Entries({"accelerometer_delay": self._delay})
        return Cure(choices=[delay], then=", or give both the same filter")


EXAMPLES = (AccelerometerLags(topic="/wrench", lag=0.0081),)

"""The table ``[undeclared]`` of an experiment file: typical figures of errors of the rig that nobody declares."""

from typing import Annotated, Any

import msgspec

from identify.judge.typical_sizes import TYPICAL
from rig.toml_tables import TomlTable, read_value, written
from uq.files.schema import in_unit, quantity_schema
from uq.sources.draw_figures import part_of


def typical(unit: str) -> msgspec.Meta:
    """Return the annotation of a typical figure, in SI, per cent in parts of one; ``false``: there is no such error."""

    def read(path: str, raw: Any) -> float | None:
        if raw is False:
            return None
        if raw is True:
            raise ValueError(f'is true: write a figure such as "1 {unit}", or false')
        return float(read_value(path, raw, Annotated[float, in_unit(unit, above=0)])) * part_of(unit)

    return written(read, {"anyOf": [quantity_schema(unit), {"const": False}]})


class UndeclaredTable(TomlTable, frozen=True, kw_only=True):
    """``[undeclared]``: typical standard uncertainties of errors that are not declared; false: there is none.

    The conventional bound of a result holds them. docs/how-to/identify.md gives the figures and where they are from.
    """

    force_gain: Annotated[float | None, typical("%")] = TYPICAL["force_gain"]
    """Gain error common to the three channels of the force."""
    force_gain_by_axis: Annotated[float | None, typical("%")] = TYPICAL["force_gain_by_axis"]
    """Gain error of each channel of the force beside the common one."""
    moment_gain: Annotated[float | None, typical("%")] = TYPICAL["moment_gain"]
    """Gain error common to the three channels of the moment."""
    moment_gain_by_axis: Annotated[float | None, typical("%")] = TYPICAL["moment_gain_by_axis"]
    """Gain error of each channel of the moment beside the common one."""
    cross_talk: Annotated[float | None, typical("%")] = TYPICAL["cross_talk"]
    """Cross-talk to each channel from every other component, in parts of the largest recorded force and moment."""
    load_cell_axes: Annotated[float | None, typical("rad")] = TYPICAL["load_cell_axes"]
    """Misalignment of the load cell with the body, about each axis."""
    gyro_scale: Annotated[float | None, typical("%")] = TYPICAL["gyro_scale"]
    """Scale error of each axis of the gyro."""
    gyro_axes: Annotated[float | None, typical("rad")] = TYPICAL["gyro_axes"]
    """Misalignment of the gyro with the body, about each axis."""
    delay: Annotated[float | None, typical("s")] = TYPICAL["delay"]
    """Delay of the gyro against the load cell."""
    mounting_frequency: Annotated[float | None, typical("Hz")] = TYPICAL["mounting_frequency"]
    """Frequency of the body's vibration on its mounting about each axis; load cell and IMU stay on the platform's
    side."""
    mass: Annotated[float | None, typical("%")] = TYPICAL["mass"]
    """Error of the mass, where it counts as exact."""
    centre_of_gravity: Annotated[float | None, typical("m")] = TYPICAL["centre_of_gravity"]
    """Error of the centre of gravity on each axis, where the estimate takes it as exact."""
    gravity: Annotated[float | None, typical("m/s^2")] = TYPICAL["gravity"]
    """Local gravity less the stated one."""
    accelerometer_scale: Annotated[float | None, typical("%")] = TYPICAL["accelerometer_scale"]
    """Scale error of each axis of the accelerometer, where the estimate takes the specific force from it."""
    accelerometer_place: Annotated[float | None, typical("m")] = TYPICAL["accelerometer_place"]
    """Error of the accelerometer's place (imu_position) on each axis, where the estimate takes the specific force from
    it."""


NONE = UndeclaredTable(**dict.fromkeys(UndeclaredTable.__struct_fields__))
"""``undeclared = "none"``: the experiment declares all errors that there are."""

"""Tables of an experiment file that state a quantity with its standard uncertainty: [scale], [datum], [fixture]."""

import numpy as np

from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from uq.experiment.recording_table import rotation
from uq.files.document import ExperimentError, Table


def parse_scale(table: Table) -> tuple[float, float]:
    """Return the table ``[scale]``: the mass that a scale tells and its standard uncertainty [kg].

    Raises:
        ExperimentError: a key is missing, unknown, or not above zero.
    """
    mass = table.quantity("mass", "kg", positive=True)
    sigma = table.quantity("standard_uncertainty", "kg", positive=True)
    table.finish()
    return mass, sigma


def parse_datum(table: Table) -> Datum:
    """Return the table ``[datum]``: a frame fixed to the body in which the result is also wanted.

    Raises:
        ExperimentError: a key is unknown, or a value that it cannot have.
    """
    to_body = rotation(table, "rotation_to_body")
    position = table.vector("position", "m", ["0 m"] * 3)
    turn = _sigma(table, "sigma_rotation", "rad")
    place = _sigma(table, "sigma_position", "m")
    table.finish()
    return Datum(np.eye(3) if to_body is None else to_body.T, position, np.diag(np.concatenate([turn, place]) ** 2))


def parse_fixture(table: Table) -> InertialParameters:
    """Return the table ``[fixture]``: a body that is to be subtracted, from Q, in B; a tensor of NaN: not stated.

    Raises:
        ExperimentError: a key is missing or unknown, or a tensor that no body has.
    """
    mass = table.quantity("mass", "kg", positive=True)
    r_cg = table.vector("r_cg_from_q", "m")
    tensor = table.table("inertia", inertia) if "inertia" in table.content else np.full(6, np.nan)
    sigma_mass = table.quantity("sigma_mass", "kg", 0.0)
    if sigma_mass < 0:
        raise ExperimentError(f"{table.path('sigma_mass')} is below zero: write a standard uncertainty")
    sigma_r_cg = _sigma(table, "sigma_r_cg", "m")
    sigma_inertia = table.table("sigma_inertia", _of_inertia, {})
    table.finish()
    spread = np.concatenate([[sigma_mass], sigma_r_cg, sigma_inertia])
    return InertialParameters(mass, r_cg, tensor, np.diag(spread**2))


def inertia(table: Table) -> np.ndarray:
    """Return a packed tensor about the centre of gravity [kg·m²] from its components.

    Raises:
        ExperimentError: a moment is missing, or no body has this tensor.
    """
    i11, i22, i33 = (table.quantity(name, "kg*m^2", positive=True) for name in ("I11", "I22", "I33"))
    i12, i13, i23 = (table.quantity(name, "kg*m^2", 0.0) for name in ("I12", "I13", "I23"))
    table.finish()
    low, middle, high = np.linalg.eigvalsh([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])
    if low <= 0 or low + middle < high * (1 - 1e-12):
        raise ExperimentError(
            f"{table.where} is no body's tensor (principal moments {low:.6g}, {middle:.6g}, {high:.6g} kg*m^2): "
            "its moments must be positive and obey the triangle inequality"
        )
    return np.array([i11, i12, i13, i22, i23, i33])


def _sigma(table: Table, key: str, unit: str) -> np.ndarray:
    """Three standard uncertainties, one an axis; none stated: zero."""
    values = table.vector(key, unit, [f"0 {unit}"] * 3)
    if (values < 0).any():
        raise ExperimentError(f"{table.path(key)} is below zero: write standard uncertainties")
    return values


def _of_inertia(table: Table) -> np.ndarray:
    values = np.array([table.quantity(name, "kg*m^2", 0.0) for name in COMPONENTS])
    table.finish()
    if (values < 0).any():
        raise ExperimentError(f"{table.where} is below zero: write standard uncertainties")
    return values

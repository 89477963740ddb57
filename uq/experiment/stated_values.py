"""Tables of an experiment file that state a quantity with its standard uncertainty: [scale], [datum], [fixture]."""

from typing import Annotated, get_args

import msgspec
import numpy as np

from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from identify.rounding import common
from rig.toml_tables import TomlTable, WrongKeyError
from uq.files.rotation_key import ROTATION
from uq.files.schema import Axes, Component, in_unit

Metre = Annotated[float, in_unit("m")]
Moment = Annotated[float, in_unit("kg*m^2", above=0)]
Product = Annotated[float, in_unit("kg*m^2")]
SigmaOfInertia = Annotated[float, in_unit("kg*m^2", least=0)]


class TensorTable(TomlTable, frozen=True, kw_only=True):
    """A figure for each component of a tensor."""

    @property
    def packed(self) -> np.ndarray:
        """Return the array of I11, I12, I13, I22, I23, I33 [kg·m²]."""
        return np.array([getattr(self, name) for name in get_args(Component)])


class InertiaTable(TensorTable, frozen=True, kw_only=True):
    """A tensor about the centre of gravity, by its entries."""

    I11: Moment
    I22: Moment
    I33: Moment
    I12: Product = 0.0
    """The tensor's entry, -∫xy dm."""
    I13: Product = 0.0
    """The tensor's entry, -∫xz dm."""
    I23: Product = 0.0
    """The tensor's entry, -∫yz dm."""

    def __post_init__(self) -> None:
        """Refuse a tensor that no body has."""
        low, middle, high = np.linalg.eigvalsh(self.packed[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
        if low <= 0 or low + middle < high * (1 - 1e-12):
            raise WrongKeyError(
                "",
                f"is no body's tensor (principal moments {', '.join(common((low, middle, high), 6))} kg*m^2): "
                "its moments must be positive and obey the triangle inequality",
            )


class InertiaUncertaintyTable(TensorTable, frozen=True, kw_only=True):
    """Standard uncertainties of a tensor's entries; zero where not stated."""

    I11: SigmaOfInertia = 0.0
    I12: SigmaOfInertia = 0.0
    I13: SigmaOfInertia = 0.0
    I22: SigmaOfInertia = 0.0
    I23: SigmaOfInertia = 0.0
    I33: SigmaOfInertia = 0.0


class ScaleTable(TomlTable, frozen=True, kw_only=True):
    """``[scale]``: the mass on the load cell as a scale shows it."""

    mass: Annotated[float, in_unit("kg", above=0)]
    """Reading of the scale."""
    standard_uncertainty: Annotated[float, in_unit("kg", above=0)]
    """Standard uncertainty of the scale's reading."""

    @property
    def value(self) -> tuple[float, float]:
        """The mass and its standard uncertainty [kg]."""
        return self.mass, self.standard_uncertainty


class DatumTable(TomlTable, frozen=True, kw_only=True):
    """``[datum]``: a frame fixed to the body in which the result is also wanted."""

    rotation_to_body: Annotated[np.ndarray, ROTATION] = msgspec.field(default_factory=lambda: np.eye(3))
    """Rotation from the datum's axes to the body's."""
    position: Axes[Metre] = (0.0, 0.0, 0.0)
    """The datum's origin from Q, in B."""
    sigma_rotation: Axes[Annotated[float, in_unit("rad", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the rotation about each axis."""
    sigma_position: Axes[Annotated[float, in_unit("m", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the position on each axis."""

    @property
    def value(self) -> Datum:
        """The frame with its covariance."""
        spread = np.square([*self.sigma_rotation, *self.sigma_position])
        return Datum(self.rotation_to_body.T, np.array(self.position), np.diag(spread))


class FixtureTable(TomlTable, frozen=True, kw_only=True):
    """``[fixture]``: a body that is to be subtracted from the identified one, from Q, in B."""

    mass: Annotated[float, in_unit("kg", above=0)]
    r_cg_from_q: Axes[Metre]
    """Centre of gravity of the fixture from Q, in B."""
    inertia: InertiaTable | None = None
    """Tensor of the fixture about its centre of gravity; without it the result has no tensor."""
    sigma_mass: Annotated[float, in_unit("kg", least=0)] = 0.0
    """Standard uncertainty of the fixture's mass."""
    sigma_r_cg: Axes[Annotated[float, in_unit("m", least=0)]] = (0.0, 0.0, 0.0)
    """Standard uncertainty of the fixture's centre of gravity on each axis."""
    sigma_inertia: InertiaUncertaintyTable = InertiaUncertaintyTable()
    """Standard uncertainties of the fixture's tensor."""

    @property
    def value(self) -> InertialParameters:
        """The fixture's ten parameters with their covariance; a tensor of NaN: not stated."""
        tensor = np.full(6, np.nan) if self.inertia is None else self.inertia.packed
        spread = np.array([self.sigma_mass, *self.sigma_r_cg, *self.sigma_inertia.packed])
        return InertialParameters(self.mass, np.array(self.r_cg_from_q), tensor, np.diag(spread**2))

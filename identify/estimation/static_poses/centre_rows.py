"""Mass and centre of gravity of static poses as rows of an identified tensor's ledger."""

import numpy as np
from jaxtyping import Float

from identify.estimation.static_poses.centre_result import Centre
from identify.least_squares.covariance_matrices import root_of
from identify.results.identification_result import CG
from identify.results.ledger import Row


def centre_rows(centre: Centre, by_centre: Float[np.ndarray, "10 4"]) -> tuple[Row, ...]:
    """Return the errors of static poses: those that last from one series of poses to the next, and all others.

    Args:
        centre: mass and centre of gravity with their covariance.
        by_centre: derivative of the ten parameters by mass and centre of gravity.
    """
    freedom = np.concatenate([np.broadcast_to(centre.degrees_of_freedom, 10)[:4], np.full(6, np.inf)])
    lasting: dict[str, list[np.ndarray]] = {}
    for name, effect in centre.lasting_errors.items():
        lasting.setdefault(name.rpartition(" ")[0], []).append(effect[:4])
    columns = {key: np.transpose(effects) for key, effects in lasting.items()}
    rest = centre.covariance[:4, :4] - sum((part @ part.T for part in columns.values()), np.zeros((4, 4)))
    columns = {"": root_of(rest, centre.covariance[:4, :4]), **columns}
    return tuple(
        Row(error=CG if " " in key or not key else key, changes=by_centre @ part, degrees_of_freedom=freedom, key=key)
        for key, part in columns.items()
    )

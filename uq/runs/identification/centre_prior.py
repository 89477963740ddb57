"""The result of static poses as the prior of a recorded run: ``inertia identify --centre``."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identify.display.rounding import common, significant
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError
from rig.read_limits import parse_json, require_file
from uq.experiment.experiment import Experiment
from uq.files.provenance import sha256
from uq.sources.source import Source

APART = 2.0
"""Standard uncertainties that two values of one quantity may differ by."""


def load_centre(path: str | Path | Centre) -> Centre:
    """Read a centre.json, as ``inertia centre --out`` writes it; a centre is returned as it is.

    Raises:
        RunError: it is not JSON, no centre, of another version, or holds figures that cannot be used.
        RigError: it is a folder, a FIFO or a device.
        OSError: it cannot be read.
        TypeError: it is neither a path nor a centre.
    """
    if isinstance(path, Centre):
        return path
    if not isinstance(path, (str, Path)):
        raise TypeError(f"Argument `centre` must be a Centre or the path of its centre.json, but is {path!r}.")
    require_file(path)
    name = Path(path).name
    try:
        content = parse_json(Path(path).read_text("utf-8"))
    except ValueError:
        raise RunError(f"{name} is not JSON: give the centre.json that `inertia centre` wrote") from None
    return Centre.from_dict(content, name)


ANYWHERE = 0.3
"""Standard uncertainty of each coordinate of a centre of gravity that is not declared, from Q [m].

Prior: wider than what a load cell of a robot or a bench carries.
"""


def with_centre_prior(experiment: Experiment, centre: Centre) -> tuple[Experiment, tuple[str, ...]]:
    """Return the experiment with the mass and centre of gravity of static poses, and where these contradict it."""
    u = centre.standard_uncertainty
    warnings = []
    if experiment.r_cg_from_q is not None:
        apart = np.abs(centre.r_cg - experiment.r_cg_from_q)
        if (apart > APART * np.hypot(u[1:4], experiment.sigma_r_cg) + 1e-9).any():
            here, there = (_millimetres(r) for r in (experiment.r_cg_from_q, centre.r_cg))
            warnings.append(
                f"body.r_cg_from_q is ({here}) mm, the static poses say ({there}) mm, further apart than their "
                "uncertainties: the poses' is used"
            )
    if experiment.mass is not None and abs(centre.mass - experiment.mass) > APART * u[0] + 1e-9:
        warnings.append(
            f"body.mass is {experiment.mass:.6g} kg, the static poses say {centre.mass:.6g} kg, further apart than "
            f"their uncertainty of {significant(u[0], 2)} kg: the poses' is used"
        )
    return with_mass_and_centre(experiment, centre.mass, centre.r_cg, u[1:4], "static poses"), tuple(warnings)


def with_mass_and_centre(
    experiment: Experiment, mass: float | None, r_cg: np.ndarray, sigma_r_cg: np.ndarray, source: str
) -> Experiment:
    """Return the experiment with another mass [kg] and centre of gravity with its standard uncertainty [m]."""
    others = tuple(source for source in experiment.sources if source.perturbs != "r_cg")
    names = {source.name for source in others}
    mixing = tuple(mixed for mixed in experiment.mixing if names.issuperset(mixed.names))
    centre_source = Source(name="r_cg", target="r_cg", kind="bias", group="cg", sigma=sigma_r_cg, reference=source)
    return replace(experiment, r_cg_from_q=r_cg, mass=mass, sources=(*others, centre_source), mixing=mixing)


def with_free_centre(experiment: Experiment) -> Experiment:
    """Return the experiment with a centre of gravity that the motion alone tells, from a wide prior about Q."""
    return with_mass_and_centre(experiment, experiment.mass, np.zeros(3), np.full(3, ANYWHERE), "not declared")


def centre_provenance(path: str | Path | Centre, centre: Centre) -> dict[str, Any]:
    """Return the provenance of the centre that a result used."""
    file = {} if isinstance(path, Centre) else {"file": str(path), "sha256": sha256(path)}
    return {**file, **{key: centre.provenance.get(key) for key in ("inputs", "package", "time")}}


def _millimetres(r: np.ndarray) -> str:
    return ", ".join(common((1e3 * x for x in r), 4))

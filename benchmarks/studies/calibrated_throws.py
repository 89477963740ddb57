"""Real throws of bodies of known tensor: each identified with a calibration of the rig by the other, and without.

``python -m benchmarks.studies.calibrated_throws FOLDER``; the folder is that of :mod:`benchmarks.studies.throws`. The
uncertainty of the geometry is not stated: 0.5 % of the moments is assumed, for a product of the mean of its two. Gyro
and flywheel were mounted by hand: for a calibration the axes of both are declared within 1.5°.
"""

import json
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.studies.throws import asked
from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.interval_quality import error_over_u
from uq.bodies.calibration.calibrate_files import calibrate_files
from uq.bodies.reference import Reference, reference
from uq.experiment.experiment import Experiment
from uq.files.toml_text import toml_text
from uq.runs.identification.identify_files import identify_files

PART = 0.005
"""Standard uncertainty of the geometry, in parts of the moments: assumed."""
AXES = {"target": "wrench", "kind": "misalignment", "sigma": ["1.5 deg"] * 3, "group": "flywheel"}


def geometry(name: str, tensor: Mapping[str, float]) -> Reference:
    """Return a body by its tensor [kg·mm²]."""

    def figure(component: str) -> dict[str, str]:
        moments = [tensor[f"I{axis}{axis}"] for axis in component[1:]]
        u = float(PART * np.sqrt(moments[0] * moments[1]))
        return {"value": f"{1e-6 * tensor[component]!r} kg*m^2", "standard_uncertainty": f"{1e-6 * u!r} kg*m^2"}

    figures = {component: figure(component) for component in COMPONENTS}
    return reference({"name": name, "cad": {"about": "CG", "products": "tensor", "inertia": figures}})


def lines(folder: Path, experiment: Experiment) -> Iterator[str]:
    """Yield error and both half-widths of each component of each body, without and with a calibration."""
    about = json.loads((folder / "truth.json").read_text())
    tensors = {name: body["inertia_total_about_cg_kgmm2"] for name, body in about.items()}
    runs = {name: sorted(folder.glob(f"{name}_*.mcap")) for name in tensors}
    wide = experiment.with_source("flywheel_axes", **AXES)
    bare = experiment.without_source(*(source.name for source in experiment.sources))
    for name in tensors:
        truth = 1e-6 * np.array([tensors[name][component] for component in COMPONENTS])
        for other in (None, *(other for other in tensors if other != name)):
            declared = wide
            if other is not None:
                calibration = calibrate_files([(geometry(other, tensors[other]), runs[other])], wide)
                with tempfile.TemporaryDirectory() as place:
                    (Path(place) / "rig.toml").write_text(toml_text(calibration.sources()))
                    declared = Experiment.from_dict({**bare.document, "include": ["rig.toml"]}, place)
                    declared = replace(declared, folder=experiment.folder)
            result = identify_files(runs[name], declared)
            ends = result.interval95
            halves = [np.ptp(each, axis=1) / 2 for each in (ends, result.conventional_bound)]
            words = "not calibrated" if other is None else f"calibrated on {other}"
            yield f"{name}, {words}, kg·mm²; error over u {error_over_u(ends, truth):.2f}"
            rows = zip(COMPONENTS, 1e6 * (result.inertia - truth), *(1e6 * half for half in halves), strict=True)
            yield from (f"  {component} {error:8.2f} ± {one:.2f} ± {two:.2f}" for component, error, one, two in rows)


def main() -> None:
    """Print the lines."""
    for line in lines(*asked(__doc__)):
        print(line, flush=True)


if __name__ == "__main__":
    main()

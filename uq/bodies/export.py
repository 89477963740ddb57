"""Inertial parameters as files for simulators, ROS and robot controllers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from identify.display.reporting import Result, plain
from identify.display.rounding import common, significant
from identify.exceptions import RunError
from identify.least_squares.admissible_tensor import distance_from_bodies
from identify.results.declaration import status
from identify.rigid_body.inertial_parameters import PARAMETERS, InertialParameters
from identify.rigid_body.principal_axes import principal
from uq.bodies.export_formats import ExportFormat, chosen, export_format
from uq.bodies.exported_body import ExportedBody
from uq.files.output_folder import HasFiles

ROUNDING = 1e-12
"""Part of the largest moment by which rounding may break the triangle inequality of a flat body."""
FITTED = "the data are weak and the exported tensor is the nearest possible one"
CHECK = "check signs, frames and r_CG, or record a more informative motion"
CORRECT = "correct what is declared, or declare what else acts"
FAR = 3.0
"""Standard uncertainties from the data beyond which the nearest body is not exported."""


@dataclass(frozen=True, repr=False)
class Exported(HasFiles, Result):
    """Export files, made but not yet written.

    Example: ``export(identification, "urdf,mjcf").write("folder")``.
    """

    contents: Mapping[str, str]
    """Text by file name."""
    formats: Mapping[str, ExportFormat]
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = "export"

    def records(self) -> list[dict[str, Any]]:
        """Return format, file and description of each."""
        return [{"format": name, "file": form.file, "what": form.description} for name, form in self.formats.items()]

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says: the files by format."""
        return {name: target_format.file for name, target_format in self.formats.items()}


def export(
    result: Any, formats: str | Sequence[str], folder: str | Path | None = None, *, force: bool = False
) -> Exported:
    """Export mass, centre of gravity and tensor in the formats of simulators, ROS and robot controllers.

    The frame is the result's declared datum; without one the body frame B with its origin at Q, the load cell's centre.
    Uncertainties and the runs' SHA-256 stand in a comment.

    Args:
        result: an :class:`identify.Identification`, or :class:`identify.InertialParameters`.
        formats: names of :mod:`uq.bodies.export_formats`, or one string of them with commas.
        folder: where to write them, all or none; None: they are only made.
        force: export a tensor that no body has, a fit to bodies that is far from the data, or what the runs contradict,
            with a warning.

    Raises:
        ExperimentError: no format, or one that there is not.
        RunError: the mass is not known; or, unless forced, the runs contradict what is declared, no body has this
            tensor, or it is a fit to bodies all of which are farther than three standard uncertainties from the data.
        OSError: the folder cannot be written.
    """
    wanted = {name: export_format(name) for name in chosen(formats)}
    body, warnings = _body(result, force=force)
    contents = {target_format.file: target_format.text(body) for target_format in wanted.values()}
    made = Exported(contents, wanted, warnings, getattr(result, "provenance", {}))
    if folder is not None:
        made.write(folder)
    return made


def _body(result: Any, *, force: bool) -> tuple[ExportedBody, tuple[str, ...]]:
    """Return the body to be exported, and warnings."""
    parameters, frame = _parameters(result)
    _refuse_unknown(parameters)
    weak, tare = getattr(result, "admissible", None), getattr(result, "tare", None)
    contradicted = getattr(result, "contradicted", "")
    no_body = _doubt(parameters, 0.0 if weak is None else weak.distance)
    doubts = [(doubt, cure) for doubt, cure in ((contradicted, CORRECT), (no_body, CHECK)) if doubt]
    if doubts and not force:
        doubt, cure = doubts[0]
        raise RunError(f"{doubt}, so it is not exported: {cure}; --force exports it anyway")
    fitted = () if weak is None else (f"{FITTED}: {weak.reason}",)
    warnings = (*(doubt for doubt, _ in doubts), *fitted)
    runs = [(run.file, run.sha256) for run in getattr(result, "runs", ())]
    runs += [] if tare is None else [(f"{file} (tare)", sha) for file, sha in tare.runs]
    notes = tuple(_notes(parameters, frame, runs, warnings))
    content = {"frame": frame, "status": status(contradicted)} | _content(parameters, runs, warnings)
    return ExportedBody(
        mass=float(parameters.mass), r_cg=parameters.r_cg, inertia=parameters.inertia, notes=notes, content=content
    ), warnings


def _parameters(result: Any) -> tuple[InertialParameters, str]:
    """The ten parameters, and in which frame."""
    if isinstance(result, InertialParameters):
        return result, "as given"
    if getattr(result, "datum", None) is not None:
        return result.parameters.in_datum(result.datum), "declared datum"
    return result.parameters, "body, origin Q (load cell's centre)"


def _refuse_unknown(parameters: InertialParameters) -> None:
    if not parameters.mass > 0:
        raise RunError("the mass is not known, and an export needs it: state body.mass, or give --centre")
    if not np.isfinite(parameters.values).all():
        raise RunError("mass, centre of gravity or tensor are not finite: identify them before they are exported")


def _doubt(parameters: InertialParameters, distance_of_fit: float) -> str | None:
    """Return the reason why the tensor should not be exported; None: it is a body's, near to the data."""
    low, middle, high = principal(np.asarray(parameters.inertia))[0]
    if low <= 0 or low + middle < high * (1 - ROUNDING):
        far = distance_from_bodies(parameters.inertia, np.nan_to_num(parameters.covariance[4:, 4:]))
        moments = f"principal moments {', '.join(common((low, middle, high), 4))} kg·m²"
        return f"no body has this tensor ({moments}; the nearest body lies {far:.1f} standard uncertainties from it)"
    if distance_of_fit > FAR:
        return f"the nearest body lies {distance_of_fit:.1f} standard uncertainties from what the data say"
    return None


def _notes(
    parameters: InertialParameters, frame: str, runs: Sequence[tuple[str, str | None]], warnings: Sequence[str]
) -> list[str]:
    """The comment: what it is, how uncertain, of which runs; ASCII only, as controllers want it."""
    u = dict(zip(PARAMETERS, parameters.standard_uncertainty, strict=True))
    stated = [f"{name} {significant(value)}" if value > 0 else f"{name} not stated" for name, value in u.items()]
    lines = [
        f"Written by inertia-uq. Tensor about the centre of gravity. Frame: {frame}.",
        f"Standard uncertainties in kg, m, kg*m^2: {', '.join(stated)}",
        *(f"run {file} sha256 {sha or 'not known'}" for file, sha in runs),
        *(f"warning: {text}" for text in warnings),
    ]
    ascii_lines = [" ".join(line.replace("·", "*").replace("²", "^2").split()) for line in lines]
    return [line.encode("ascii", "replace").decode() for line in ascii_lines]


def _content(
    parameters: InertialParameters, runs: Sequence[tuple[str, str | None]], warnings: Sequence[str]
) -> dict[str, Any]:
    """Return the additional content of the JSON format; unknown values are null."""
    return {
        "standard_uncertainty": {
            name: plain(u) or None for name, u in zip(PARAMETERS, parameters.standard_uncertainty, strict=True)
        },
        "covariance": {
            "order": list(PARAMETERS),
            "values": plain(parameters.covariance),
        },
        "runs": [{"file": file, "sha256": sha} for file, sha in runs],
        "warnings": list(warnings),
    }

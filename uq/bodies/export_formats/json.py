"""JSON: everything that is known, with covariance and provenance."""

from json import dumps

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody


def json(body: ExportedBody) -> str:
    """Return everything that is known."""
    moments, axes = body.principal()
    content = {
        "name": body.name,
        "mass": {"value": body.mass, "unit": "kg"},
        "cg": {"value": body.r_cg.tolist(), "unit": "m", "from": "origin of the frame"},
        "inertia": {**body.named, "unit": "kg*m^2", "about": "CG"},
        "principal": {"moments": moments.tolist(), "axes": axes.T.tolist()},
        **body.content,
    }
    return dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


FORMAT = ExportFormat("body.json", "JSON with covariance and provenance", json)

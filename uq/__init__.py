"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

The public names are imported on first use, so that ``inertia record`` starts without waiting for JAX. Each is in
docs/reference/api.md; everything else is imported from its room, such as ``uq.sources.distributions``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # the names stand in __init__.pyi

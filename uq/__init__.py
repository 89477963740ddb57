"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

The public names are imported on first use, so that ``inertia record`` starts without waiting for JAX. Each is in
docs/reference/api.md; everything else is imported from its room, such as ``uq.sources.distributions``.
"""

from contextlib import suppress

import lazy_loader

with suppress(ImportError):  # of another package named identify; the command says what to do about it
    from uq.report import views as _views  # noqa: F401 - it registers how results are shown

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # the names stand in __init__.pyi

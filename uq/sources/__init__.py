"""Error sources: kinds, distributions and correlations, draws."""

import uq.sources.kinds  # noqa: F401  every kind is registered before a source of it is asked for

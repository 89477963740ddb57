"""Error sources: what they perturb, their kinds, distributions and correlations, their draws."""

import uq.sources.kinds  # noqa: F401  every kind is registered before a source of it is asked for

"""Tables and texts of results, a view a type: see :mod:`uq.report.views`."""

"""Findings on signals and residuals of runs, a file each: what it looks like, why it matters, how it is decided, cure.

How often each is named: docs/explanation/findings.csv, by ``tests.helpers.operating_curves``.
"""

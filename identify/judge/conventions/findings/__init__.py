"""Findings on conventions, a file each: what it looks like, why it matters, how it is decided, what to do.

How often each is named: docs/explanation/findings.csv, by ``tests.helpers.operating_curves``.
"""

"""Platforms on six legs: the trajectory of least predicted uncertainty under their limits, its report and files."""

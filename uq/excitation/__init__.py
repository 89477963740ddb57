"""Excitation: the trajectory of least predicted uncertainty under a platform's limits."""

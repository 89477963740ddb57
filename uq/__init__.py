"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

Public names are imported on first use, so that ``inertia record`` starts without waiting for JAX.
"""

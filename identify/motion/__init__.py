"""Motions of the platform: trajectories, legs and their limits, the optimiser."""

"""Motions of the platform: trajectories, the six legs and their limits, periodic and staged motions, the optimiser."""

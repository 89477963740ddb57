"""Tensor, rotations, Newton and Euler, the regressor Omega_R, solids, the fixture."""

"""The rigid body: tensor, rotations, Newton and Euler, the regressor Omega_R, simple solids, the fixture."""

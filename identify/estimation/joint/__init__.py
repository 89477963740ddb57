"""The joint estimator of tensor, mass, centre, offsets, delay and rotation; the Cramér–Rao bound."""

"""The joint estimator: tensor, mass, centre, offsets, delay and rotation from all channels; the Cramér–Rao bound."""

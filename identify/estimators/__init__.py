"""Gram sums, (generalised) least squares, offsets, admissible tensors, pooling."""

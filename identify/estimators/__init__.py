"""Gram sums, least squares, generalised least squares, offsets, admissible tensors, pooling."""

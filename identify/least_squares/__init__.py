"""Least squares: a run's rows, sums and residuals, normal equations, offsets, admissible tensors, pooling."""

"""Gram sums under constant errors and noise: linear maps, exact moments, batched solutions."""

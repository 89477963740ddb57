"""Gram sums under constant errors and noise: exact moments, batched solutions."""

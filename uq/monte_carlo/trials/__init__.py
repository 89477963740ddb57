"""Trials of a Monte Carlo: one, batches, several processes, checkpoints."""

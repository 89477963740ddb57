"""Trials of a Monte Carlo: one trial, batches of them, several processes, checkpoints."""

"""Uncertainty without trials, and its parts: propagation, sensitivity."""

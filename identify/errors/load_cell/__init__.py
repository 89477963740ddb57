"""Errors of the load cell: axes, cross-talk, gains, zeros."""

"""Diagnostics of a run: causes of its residuals, spectral lines, conventions of axes, signs and units; predictions."""

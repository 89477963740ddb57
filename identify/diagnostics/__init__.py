"""Causes of residuals, spectral lines, conventions of axes, signs and units."""

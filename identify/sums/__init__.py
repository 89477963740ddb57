"""Rows of the regression, what they leave behind for every estimate, residual spectra."""

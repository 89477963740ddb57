"""Sampled signals: resampling, differentiation, filters, spectra, moving segments."""

"""Sampled signals of a run: resampling, differentiation, filters, spectra, segments that move or rest."""

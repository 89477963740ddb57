"""What the residuals of a run say: their possible causes, spectral lines, the consistency verdict."""

"""Findings on the signals and residuals of runs, a file each: what it looks like, how it is decided, what to do."""

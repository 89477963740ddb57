"""The trajectory of least predicted uncertainty under a platform's limits."""

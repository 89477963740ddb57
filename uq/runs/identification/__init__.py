"""Identification of recorded runs: declared and undeclared errors, static centre, tare, scatter of runs."""

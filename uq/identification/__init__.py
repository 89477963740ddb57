"""Identification of recorded runs: declared sources, static centre, tare, scatter of runs."""

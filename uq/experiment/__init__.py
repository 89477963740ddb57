"""Experiment files: every table of EXPERIMENT.toml as typed values in SI."""

"""Experiment files: every table as typed values in SI."""

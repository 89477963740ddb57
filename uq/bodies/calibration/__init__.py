"""Calibration of the rig by runs of known bodies."""

"""Errors of the rig, one file each: what it does to a run, how large it usually is, how it is named and cured."""

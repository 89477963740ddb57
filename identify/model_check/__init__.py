"""Contradictions in a run: causes in the rig or its declaration, by force and moment."""

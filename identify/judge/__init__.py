"""Contradictions of a result: causes in the rig or its declaration, with evidence, size and cure; held-out runs."""

"""Contradictions of a result: causes in the rig or its declaration, each with evidence, size and cure; held-out runs."""

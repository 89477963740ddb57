"""Contradictions of a recorded run with mechanics or with the experiment, and their cure."""

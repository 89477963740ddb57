"""Recorded runs: from a file and its declaration to signals on the body."""

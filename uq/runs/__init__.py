"""Recorded runs: from files and tables to signals, findings, and the tensor with its uncertainty."""

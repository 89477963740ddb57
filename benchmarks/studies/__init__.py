"""Proofs and studies whose figures stand in docs/: what a reader of a report does not need (``python -m``)."""

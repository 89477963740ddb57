"""Identifications as the command makes them: of one body with what it is compared with, or of a night's jobs."""

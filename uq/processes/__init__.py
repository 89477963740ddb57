"""Processes that do tasks, one after another each: jobs of a night, runs of a body."""

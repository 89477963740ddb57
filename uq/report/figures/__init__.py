"""Figures of results, a module a result: each function draws one with matplotlib, which is imported with its module."""

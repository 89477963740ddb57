"""Errors of platform, mounting and surroundings: gravity, flexibility, cables, air."""

"""Reference bodies, normalised error, exports to simulators and robots."""

"""Bodies beside the measurement: reference bodies, normalised error, exports to simulators and robots."""

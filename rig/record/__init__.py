"""Recording: ports, readers, clocks, the growing file."""

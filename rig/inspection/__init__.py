"""What is wrong with a recorded run: rates, gaps, clocks, units, signs, axes."""

"""The health of a recorded run's channels: rates, gaps, clocks, held and saturated samples."""

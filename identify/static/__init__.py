"""Static poses: mass, centre of gravity and load-cell offsets, and the poses that determine them best."""

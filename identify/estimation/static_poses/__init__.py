"""Static poses: mass, centre of gravity, offsets, and the poses that tell most."""

"""What in a recorded run contradicts mechanics or the experiment, and its cure."""

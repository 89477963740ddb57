"""What contradicts mechanics or the experiment in a recorded run, and the line of the experiment file that cures it."""

"""What an identification returns: the tensor with its uncertainty, one run's estimate, alignment, weak components."""

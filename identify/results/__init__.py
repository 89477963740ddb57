"""What an identification returns: tensor and uncertainty, alignment, weak components."""

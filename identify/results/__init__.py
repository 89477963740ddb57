"""Results of an identification: tensor and uncertainty, alignment, weak components."""

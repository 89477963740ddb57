"""Error sources: what they perturb, their distributions and correlations, their draws."""

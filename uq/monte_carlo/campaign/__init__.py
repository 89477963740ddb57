"""Monte Carlo campaigns: from an experiment to mean error and 3σ."""

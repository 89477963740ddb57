"""Monte Carlo: trials of an experiment, their statistics and coverage."""

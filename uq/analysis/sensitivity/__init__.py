"""Sobol indices, Shapley effects, the budget by error source."""

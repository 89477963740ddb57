"""Estimators: from runs, static poses and priors to the tensor."""

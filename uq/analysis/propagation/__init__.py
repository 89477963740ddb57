"""Propagation of uncertainty: the law (GUM), distributions (Supplements 1 and 2)."""

"""What a platform really ran, beside its plan."""

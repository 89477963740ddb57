"""The motion that a platform really ran, beside its plan."""

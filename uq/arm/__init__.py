"""Robot arms: the joint motion of least predicted uncertainty, its files, its simulation before anything moves."""

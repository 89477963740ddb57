"""Robot arms: the best joint motion, its files, its simulation before anything moves."""

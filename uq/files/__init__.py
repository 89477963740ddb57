"""Units, TOML tables, columns of a CSV table, provenance, the output folder."""

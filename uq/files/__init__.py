"""Files in and out: units, TOML tables, columns of a CSV table, provenance, the output folder."""

"""Display of results: numbers, tables and figures for a terminal, a notebook, JSON, a DataFrame."""

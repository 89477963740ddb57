"""How numbers, tables and figures of a result are shown: terminal, notebook, JSON, DataFrame."""

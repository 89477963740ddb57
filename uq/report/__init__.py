"""One HTML page that stands alone, certificates, a result's files."""

"""Reports: one HTML page that stands alone, certificates, a result's files."""

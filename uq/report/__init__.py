"""Tables, figures and texts of every result, certificates, one HTML page that stands alone, a result's files."""

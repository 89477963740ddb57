"""The MCAP file: container, checksums, CDR messages, recovery of damaged files."""

"""An estimate beside a recording: a second process that reads the growing file and adds sums block by block."""

"""Functions that the commands share: start, end, output folder, progress, several processes."""

"""What the commands share: how they start and end, the output folder, progress, several processes."""

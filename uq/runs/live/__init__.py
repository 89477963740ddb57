"""An estimate beside a growing recording, in a second process."""

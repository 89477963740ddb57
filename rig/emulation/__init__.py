"""Emulated sensors: a process that plays a run through pseudo-terminals and sockets."""

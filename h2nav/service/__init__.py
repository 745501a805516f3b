"""The behaviour of the daemon without I/O: events in, effects out."""

"""The live view: a separate process that shows the daemon's records while it runs."""

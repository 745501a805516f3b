"""The program's MCAP logs: written, repaired, read, exported."""

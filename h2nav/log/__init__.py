"""Our MCAP logs: written, repaired, read, exported."""

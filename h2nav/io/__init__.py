"""Everything that opens something: wire, links, logs, files."""

"""One module per command; they only wire the rooms together."""

"""One module per command; they only connect the rooms."""

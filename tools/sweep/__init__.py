"""Known faults, put into recorded flights to see what the review says of them."""

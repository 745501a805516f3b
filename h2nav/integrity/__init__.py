"""What is wrong, from when, and how we know: checks of sensors, of our attitude and of another."""

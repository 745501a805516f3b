"""The flight review: one flight as a whole, what was wrong in it, and a page that shows it."""

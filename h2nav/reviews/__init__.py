"""The flight review: analyses a flight as a whole, and shows the findings on a page."""

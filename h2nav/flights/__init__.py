"""The record of flights: recordings in a folder, the review of each, and an index of them."""

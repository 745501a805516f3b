"""Flight recordings of every kind, as events of the service and as context for the review."""

"""Flights with truth: h2nav through its own service, next to the autopilot's estimators."""

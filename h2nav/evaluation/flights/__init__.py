"""Flights with truth: h2nav through its own service, compared with the autopilot's estimators."""

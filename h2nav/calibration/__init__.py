"""Calibration from flights: the errors of sensors, as parameters to load."""

"""Calibrations out of flights: what sensors are off by, as parameters that one can load."""

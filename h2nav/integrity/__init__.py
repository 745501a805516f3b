"""Fault detection: checks of the sensors, of our attitude and of the autopilot's."""

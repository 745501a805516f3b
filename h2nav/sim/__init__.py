"""A simulated vehicle, its sensors and its autopilot, without I/O."""

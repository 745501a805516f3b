"""The autopilot's own log over MAVLink, without I/O."""

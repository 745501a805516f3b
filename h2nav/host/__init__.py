"""The host computer: its clocks, its service manager."""

"""The computer that we run on: its clock, its service manager."""

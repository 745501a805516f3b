"""The constant-gain filter, in 32-bit integers, for the smallest microcontrollers."""

"""The constant-gain filter, in 32-bit integers: what the smallest microcontrollers can afford."""

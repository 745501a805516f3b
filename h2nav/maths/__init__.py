"""Pure mathematics: rotations, rigid motions, frames. No clock, no I/O, no MAVLink."""

"""Links to autopilots and to programs beside us: UDP, TCP, serial ports, local sockets."""

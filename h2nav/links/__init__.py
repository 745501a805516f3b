"""Links to autopilots and to local programs: UDP, TCP, serial ports, Unix sockets."""

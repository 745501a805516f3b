"""What the integer kernels of all filters share: turning an attitude, and finding one."""

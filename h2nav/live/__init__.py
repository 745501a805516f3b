"""What others see while the daemon flies: a process of its own that shows what it is given."""

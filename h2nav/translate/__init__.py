"""Translation of the filters' step functions from Python to freestanding C99, with proved ranges."""

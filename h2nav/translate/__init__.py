"""Translates the filters' step functions to freestanding C99 and proves their integer ranges."""

"""One step of the velocity-aided filter in floats, in the translatable subset."""

"""One step of the velocity-aided filter in integers, in the translatable subset."""

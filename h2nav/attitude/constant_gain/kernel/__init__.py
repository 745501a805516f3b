"""One step of the constant-gain filter in integers, in the translatable subset."""

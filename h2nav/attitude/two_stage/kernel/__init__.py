"""One step of the two-stage filter, in the translatable subset."""

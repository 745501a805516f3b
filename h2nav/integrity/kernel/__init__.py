"""The watch over one IMU, run with every sample, in the translatable subset."""

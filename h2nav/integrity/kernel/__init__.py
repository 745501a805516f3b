"""What the watch over one IMU does with every sample, in the translatable subset."""

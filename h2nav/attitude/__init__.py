"""The attitude estimator: samples in, estimates out."""

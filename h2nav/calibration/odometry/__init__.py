"""Calibration of wheel odometry from tables and recordings, and the drive repeated with it."""

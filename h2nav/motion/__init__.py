"""Twist observer, wheel odometry and its calibration."""

"""Accuracy of filters, observer and odometry against truth, for the evaluate commands."""

"""Attitude filters of h2nav and of others on recorded trials with truth."""

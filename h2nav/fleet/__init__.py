"""Thousands of flights: one task and one row each, whatever happens to a single one."""

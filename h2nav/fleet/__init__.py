"""Thousands of flights: one task each, one row each, whatever becomes of a single one."""

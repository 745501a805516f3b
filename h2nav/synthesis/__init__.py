"""Offline gain synthesis and certificates; the only importer of cvxpy and scipy."""

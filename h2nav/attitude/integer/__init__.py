"""Shared parts of the integer kernels: rotating an attitude, and finding one."""

"""Gains computed in advance: the envelope of a gain file, its seal, shared parts."""

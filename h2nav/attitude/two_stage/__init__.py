"""The two-stage filter, in floats. Equations: docs/derivation.md section 3."""

"""The velocity-aided filter in 32-bit integers. Formats and proofs: docs/fixed-point.md."""

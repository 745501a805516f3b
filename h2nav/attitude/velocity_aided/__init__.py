"""The velocity-aided filter: the default one. Equations: docs/filter.md."""

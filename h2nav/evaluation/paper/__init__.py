"""The source paper's filters and tables, reproduced; README.md says what stands where."""

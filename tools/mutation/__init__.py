"""Mutation testing: `operators` make mutants, `line_map` picks tests, `trial` runs them."""

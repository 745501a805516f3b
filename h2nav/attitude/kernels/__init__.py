"""Per-sample arithmetic in the subset of Python that also translates to C99.

A kernel function takes scalars and flat lists, uses scalar locals, if/elif/else, `for i in
range(CONSTANT)`, + - * /, comparisons, math functions of scalars and other kernel functions, and
nothing else. Indices are named module constants.
"""

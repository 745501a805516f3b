"""The public API of `import h2nav`: filter and smoother on arrays, recordings, reviews."""

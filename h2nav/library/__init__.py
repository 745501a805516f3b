"""What `import h2nav` offers: filter and smoother on arrays, recordings, reviews."""

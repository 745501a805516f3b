"""What is remembered of an airframe: figures of each flight, their trends, an odometer."""

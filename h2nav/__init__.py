"""h2nav: an independent attitude and motion service for companion computers."""

__version__ = "0.1.0"

"""Foreign files, read strictly and at a bounded cost; gain files, keys, settings."""

"""A run\x27s folder and what is derived from it."""

"""Several results: depth over stage positions, or error over time."""

"""Two results, and the difference between them."""

"""Writing a result in formats of other programs."""

"""One page or dock a file."""

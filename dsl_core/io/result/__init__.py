"""Results on disk, and the marks that belong to them."""

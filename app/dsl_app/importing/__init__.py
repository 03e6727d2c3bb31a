"""Import of folders that other programs wrote."""

"""Small controls that several slices use."""

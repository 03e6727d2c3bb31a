"""Reconstructing a scan again with other parameters."""

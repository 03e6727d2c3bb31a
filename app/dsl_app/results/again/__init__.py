"""Reconstruction of a scan with other parameters."""

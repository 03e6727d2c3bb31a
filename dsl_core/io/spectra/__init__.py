"""Spectra as files."""

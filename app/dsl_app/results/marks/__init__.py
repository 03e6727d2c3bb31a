"""Pins, regions and references, and their spectra."""

"""Scans, results, rigs and spectra on disk."""

"""Patterns: encode and decode side by side."""

"""Contrast of the picture shown, and three bands as its colours."""

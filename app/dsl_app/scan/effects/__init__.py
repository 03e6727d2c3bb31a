"""The effects of light that the twin renders."""

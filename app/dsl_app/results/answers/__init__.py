"""Answers from a result: which material is where, and of which colour."""

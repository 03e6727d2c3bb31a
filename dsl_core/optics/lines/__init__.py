"""Scan lines: which there are, how a line looks across columns, and the equations of what they light."""

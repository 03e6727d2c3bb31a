"""Drivers of real hardware, one file each; only the registry sees them."""

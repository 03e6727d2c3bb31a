"""Headless engine of dsl-scan: Dispersed Structured Light without a window."""

__version__ = "0.1.0"

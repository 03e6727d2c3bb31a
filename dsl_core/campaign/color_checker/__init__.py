"""The Color Checker calibration, step by step."""

"""The Spectralon calibration, step by step."""

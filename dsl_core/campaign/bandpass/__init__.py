"""The bandpass calibration, step by step."""

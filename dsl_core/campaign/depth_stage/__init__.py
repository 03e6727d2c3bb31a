"""The depth-stage calibration, step by step."""

"""The calibration of lenses and pose, step by step."""

"""A calibration step by step: settings, placement, look, capture and fit."""

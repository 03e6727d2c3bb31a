"""Faults that were there from the first picture on: none differs, but all contradict light or calibration."""

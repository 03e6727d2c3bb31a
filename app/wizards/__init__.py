"""One file a calibration."""

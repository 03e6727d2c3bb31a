"""Records of what each calibration found."""

"""The Calibrate page: campaigns, the library of calibrations and the drift check."""

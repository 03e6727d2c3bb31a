"""What a fit is judged by, a file for each calibration."""

"""What is said of how well the model fits a scan, in sentences with the figures that show it."""

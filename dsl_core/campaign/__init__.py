"""Calibrations as guided steps: what a wizard and the command line both drive."""

"""What the calibrations share: recipe, captures, exposures and targets."""
